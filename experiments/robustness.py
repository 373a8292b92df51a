"""Proof before score: margins and coupled stability of a controller from linear models.

Every plant, causality, speed, operating point (experiments.operating_points) and arm gets an
``Assessment``; ``safe`` makes a ``Gate`` of them. A controller is unsafe where the loop with an arm of
the grid is unstable although the reference itself, perfectly tracked, is stable with that arm. Where
the reference is unstable by itself (experiments.perfect_tracking) the place is listed as such.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments import linear_loop, perfect_tracking
from experiments.law_half import law_half
from experiments.linear_loop import Half
from experiments.margins import Margins, margins
from experiments.operating_points import POINTS, Place, place_of
from steer_env.envs.layout import PERIOD
from steer_env.interface import Controller
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Make = Callable[[Plant, Reference, str], Controller]

OMEGA = np.geomspace(2.0 * np.pi * 0.05, np.pi / PERIOD, 400)  # rad/s, up to half the sampling frequency
PASSIVITY_OMEGA = 2.0 * np.pi * np.geomspace(0.2, 30.0, 150)  # rad/s
SCALES = (0.0, 0.125, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)  # of the arm, tried for the radius
HALVINGS = 5  # of the step between two scales
KEPT = 256  # environments that are kept between controllers


class Assessment(NamedTuple):
    """One loop; ``growth`` in 1/s and ``frequency_Hz`` are those of its fastest growing mode.

    ``reference_growth`` is the perfectly tracked reference's with the same arm. Margins are those of
    the loop opened at the motor's command, 0 where it is unstable (experiments.margins has limits).
    ``arm_radius`` is the smallest factor on the arm's inertia, damping and stiffness together that
    destabilises the loop (4: none up to there; 0: unstable without an arm), ``reference_radius`` the
    reference's. ``passivity_gap`` in N m s/rad is min over 0.2-30 Hz of Re Z - Re Z_ref at the wheel.
    """

    plant: str
    causality: str
    speed_kmh: float
    point: str
    arm: str
    growth: float
    frequency_Hz: float
    reference_growth: float
    stable: bool
    reference_stable: bool
    gain_margin_dB: float
    phase_margin_deg: float
    disk_margin: float
    delay_margin_ms: float
    arm_radius: float
    reference_radius: float
    passivity_gap: float

    @property
    def place(self) -> str:
        """Where this is, in words."""
        return f"{self.plant} {self.causality}, {self.speed_kmh:g} km/h, {self.point}, {self.arm}"


class Gate(NamedTuple):
    """``failures`` are the controller's, ``reference_failures`` the reference's own; the rest is the worst.

    Worst values are taken where the reference is stable; ``arm_radius`` where it is not the
    reference's own.
    """

    safe: bool
    failures: tuple[str, ...]
    reference_failures: tuple[str, ...]
    growth: float
    gain_margin_dB: float
    phase_margin_deg: float
    disk_margin: float
    delay_margin_ms: float
    arm_radius: float
    passivity_gap: float


class _Surroundings(NamedTuple):
    """What does not depend on the controller: halves [arms x SCALES] and [1, no arm], responses, reference."""

    scaled: Half
    free: Half
    responses: list[Complexes]
    reference_growths: Array
    reference_impedance: Complexes


def assess(
    make: Make,
    plant: str | Plant,
    causality: str,
    reference: Reference | str = "published",
    speeds_kmh: Iterable[float] | None = None,
    arms: Mapping[str, Driver] = DRIVERS,
    points: Sequence[str] = POINTS,
    hardware: Plant | None = None,
) -> list[Assessment]:
    """Every speed x point x arm of one plant and causality; all speeds of the reference where none is given.

    ``make(plant, reference, causality)`` gives the controller. ``hardware`` is the plant that is really
    there (``drawn`` from the spread, say) where it is not the one that the controller was made for.
    """
    told = PLANTS[plant] if isinstance(plant, str) else plant
    felt = Reference.load(reference)
    chosen = [row.speed_kmh for row in felt.file.rows] if speeds_kmh is None else list(speeds_kmh)
    controller = make(told, felt, causality)
    found = []
    for speed in chosen:
        for point in points:
            place = place_of(told, causality, felt, speed, point, hardware)
            found += _assess_place(controller, told.name, causality, speed, place, arms)
    return found


def _assess_place(
    controller: Controller, plant: str, causality: str, speed_kmh: float, place: Place, arms: Mapping[str, Driver]
) -> list[Assessment]:
    around = _surroundings(place, tuple(arms.values()))
    law = law_half(controller, place)
    rates = linear_loop.modes(linear_loop.closed_loop(around.scaled, law).A)
    law_response = linear_loop.response(law, OMEGA)
    Z = linear_loop.impedance(linear_loop.closed_loop(around.free, law), PASSIVITY_OMEGA)
    gap = float(np.min((Z - around.reference_impedance).real))
    found = []
    for k, (name, arm) in enumerate(arms.items()):
        own = slice(k * len(SCALES), (k + 1) * len(SCALES))
        worst = rates[own][SCALES.index(1.0)][0]
        stable = bool(worst.real < 0.0)
        values = Margins()
        if stable:
            one = Half(*(matrix[own][SCALES.index(1.0)] for matrix in around.scaled))
            values = _margins(one, law, around.responses[k], law_response, rates[own][SCALES.index(1.0)])
        reference_growth = float(around.reference_growths[own][SCALES.index(1.0)])
        found.append(
            Assessment(
                plant,
                causality,
                speed_kmh,
                place.point,
                name,
                float(worst.real),
                float(worst.imag / (2.0 * np.pi)),
                reference_growth,
                stable,
                reference_growth < 0.0,
                *values,
                _radius([r[0].real for r in rates[own]], arm, lambda scaled: _growth(place, scaled, law)),
                _radius(
                    around.reference_growths[own].tolist(),
                    arm,
                    lambda scaled: float(perfect_tracking.growths(place, [scaled])[0]),
                ),
                gap,
            )
        )
    return found


def scaled_arm(arm: Driver, scale: float) -> Driver:
    """The arm with inertia, damping and stiffness times ``scale``."""
    return arm._replace(J=scale * arm.J, b=scale * arm.b, k=scale * arm.k)


def _surroundings(place: Place, arms: tuple[Driver, ...]) -> _Surroundings:
    key = (place.parameters.tobytes(), place.state.tobytes(), place.lines.tobytes(), place.point, arms)
    if key in _KEPT:
        _KEPT.move_to_end(key)
        return _KEPT[key]
    tried = [scaled_arm(arm, scale) for arm in arms for scale in SCALES]
    scaled = linear_loop.environment_half(place, tried)
    ones = range(SCALES.index(1.0), len(tried), len(SCALES))
    made = _Surroundings(
        scaled,
        linear_loop.environment_half(place, [perfect_tracking.NO_ARM]),
        [linear_loop.response(_motor_only(scaled, k), OMEGA) for k in ones],
        perfect_tracking.growths(place, tried),
        perfect_tracking.impedance(place, PASSIVITY_OMEGA),
    )
    _KEPT[key] = made
    if len(_KEPT) > KEPT:
        _KEPT.popitem(last=False)
    return made
