"""Does a linear finding hold in the program itself? A kick at an operating point, without noise.

Two compiled runs start where the point is (experiments.operating_points), one of them with the wheel
a little faster. How their difference grows or decays is measured and laid beside the eigenvalue. A
third run gets a kick that a hand would feel, with the motor's limits and the sensors' resolution in
place: what is left of it after some seconds tells whether friction and limits catch an unstable loop
in a limit cycle. Only where friction sticks: a wheel that slides does not stay at its point.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.assessment import Assessment
from experiments.law_half import settled
from experiments.operating_points import Place, place_of, with_arms
from experiments.rollout import rollout_of
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Truth
from steer_env.interface import Controller
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, Plant, Reference

Array = NDArray[np.float64]

KICK, LINEAR = 1e-6, (1e-10, 1e-3)  # rad/s of the wheel; where the difference is neither lost nor large
ASTRAY = 1e-2  # rad/s; beyond it the run without a kick has left the point as well
CYCLES, WINDOWS_S = 1.0, (0.02, 0.25)  # cycles that are averaged over, within these times
FELT_KICK = 0.3  # rad/s
SECONDS, LAST = 5.0, 1.0  # s of a run, and of its end that is looked at
LEAST_WINDOWS = 4  # to fit a rate of growth to


class Confirmation(NamedTuple):
    """``growth`` and ``simulated_growth`` in 1/s; ``agrees`` where both have the same sign.

    Both are None where the difference of the runs was lost too soon to be measured.

    ``left_Nm`` is the torsion-bar torque's peak-to-peak in the last second after a kick that is felt,
    ``thrown`` where the wheel left sane limits before.
    """

    plant: str
    causality: str
    speed_kmh: float
    point: str
    arm: str
    growth: float
    simulated_growth: float | None
    agrees: bool | None
    left_Nm: float
    thrown: bool


def confirm(controller: Controller, plant: Plant, reference: Reference, found: Assessment) -> Confirmation:
    """Simulate the place of an assessment (friction stuck) with an arm out of DRIVERS."""
    controller.reset(PERIOD)
    place = place_of(plant, found.causality, reference, found.speed_kmh, found.point)
    arm = DRIVERS[found.arm]
    simulated = simulated_growth(controller, place, arm, found.frequency_Hz)
    row = with_arms(place, [arm])[0]
    row[PARAMETERS["motor"]] = plant.motor
    row[PARAMETERS["sensors"]] = plant.sensors._replace(angle_noise=0.0, torque_noise=0.0)
    signals = _run(controller, place, row, FELT_KICK)
    torque = signals[-round(LAST / PERIOD) :, Truth._fields.index("torsion_bar_torque")]
    return Confirmation(
        *found[:5],
        found.growth,
        simulated,
        None if simulated is None else (simulated < 0.0) == found.stable,
        float(np.ptp(torque)),
        bool(signals[-1, Truth._fields.index("unstable")] > 0.5),
    )


def worst_stuck(found: list[Assessment]) -> Assessment:
    """The assessment with the fastest growth among those that can be simulated."""
    return max((a for a in found if a.point.endswith("stuck")), key=lambda a: a.growth)


def simulated_growth(controller: Controller, place: Place, arm: Driver, frequency_Hz: float = 0.0) -> float | None:
    """Rate of growth in 1/s of a small difference between two runs; None where it is lost too soon.

    The size of the difference in both bodies' rates is averaged over cycles of ``frequency_Hz``; the
    later half is fitted, where the fastest growing mode is alone.
    """
    row = with_arms(place, [arm])[0]
    still, kicked = (_run(controller, place, row, kick) for kick in (0.0, KICK))
    length = min(len(still), len(kicked))
    columns = [Truth._fields.index(name) for name in ("steering_rate", "pinion_rate")]
    kicked, still = kicked[:length, columns], still[:length, columns]
    seconds = min(max(CYCLES / max(frequency_Hz, 0.1), WINDOWS_S[0]), WINDOWS_S[1])
    window = round(seconds / PERIOD)
    size, drift = _size(kicked - still, window), _size(still, window)
    n = len(size)
    outside = np.flatnonzero((size < LINEAR[0]) | (size > LINEAR[1]) | (drift > ASTRAY))
    n = int(outside[0]) if outside.size else n
    if n < LEAST_WINDOWS:
        return None
    late = np.arange(n // 2, n)
    return float(np.polyfit(late * window * PERIOD, np.log(size[late]), 1)[0])


def _size(rates: Array, window: int) -> Array:
    """Root mean square of both rates [n, 2] over windows of so many periods."""
    n = len(rates) // window
    return np.sqrt((rates[: n * window] ** 2).sum(axis=1).reshape(n, window).mean(axis=1))


def _run(controller: Controller, place: Place, row: Array, kick: float) -> Array:
    """Signals [n, fields of Truth] of SECONDS from the place with the wheel ``kick`` rad/s faster."""
    state, observation = settled(controller, place)
    rows = place.state.copy()
    rows[STATE.column("plant", "steering_rate")] += kick
    rows[STATE["judge"]] = rows[STATE["generator"]]
    signals = np.zeros((round(SECONDS / PERIOD), len(Truth._fields)))
    ran = rollout_of(controller.law)(
        state, controller.parameters, observation, np.zeros((len(signals), 2)), row.copy(), rows,
        place.lines.copy(), place.table, place.car_table, signals,
    )  # fmt: skip
    return signals[:ran]
