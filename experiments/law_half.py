"""The control law's half of the loop: brought to an operating point, then differentiated there.

The law runs compiled through what it would see if everything tracked perfectly on the way to the
point, the last commands among it: while friction slides, a wheel that turns steadily; where it
sticks, an angle that swings to and fro less and less, which leaves a friction model at zero torque as
it does friction itself. On centre with friction stuck it is at its start. At the point its last
command is what it gave itself: a law that waits while its command is cut does not wait there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.linear_loop import COMMANDS, MEASURED, Half
from experiments.operating_points import Place
from steer_env.envs.layout import PERIOD
from steer_env.interface import Controller, Law, Observation
from steer_env.physics._jit import compiled_with, named
from steer_env.physics.rows import loader

Array = NDArray[np.float64]

STEP = 1e-7  # of every state and observation, in SI
SWING, SWING_Hz, SWING_KEPT = 0.05, 20.0, 0.8  # rad, and the share that is left after a cycle
_observation = loader(Observation, 0)
SWINGING, QUIET, SLIDING = 3.0, 0.5, 0.8  # s


def has_law(controller: object) -> bool:
    """Whether a controller has a pure law, which can be linearised (experiments.periodic_loop) and runs compiled."""
    return hasattr(controller, "law")


def periods_in_step(controller: object) -> int:
    """Control periods from one action of a controller to the next: 1, or the ``decimation`` of a policy."""
    return int(getattr(controller, "decimation", 1))


def law_half(controller: Controller, place: Place) -> Half:
    """The controller, just reset, about a place: inputs MEASURED, output the motor's target of the period to come.

    One half stands for every period: not for a policy, see ``periodic_loop.law_halves``. States: the law's own and the
    last commands. A period's target follows from what was seen in the period before, so D is zero.
    """
    state, observation = settled(controller, place)
    return slopes_at(controller.law, controller.parameters, state, observation)


def slopes_at(law: Law, parameters: Any, state: Any, observation: Observation) -> Half:
    """The law differentiated at a state and an observation; see ``law_half``."""
    leaves, rebuild = flat(state)
    start, m = np.array([*leaves, *observation]), len(leaves)

    def after(moved: Array) -> Array:
        seen = moved[None, m:]
        torque, new = _driven(law)(rebuild(moved[:m].tolist()), parameters, seen)
        return np.array([*flat(new)[0], torque])

    columns = []
    for unit in STEP * np.eye(start.size):
        columns.append((after(start + unit) - after(start - unit)) / (2.0 * STEP))
    slopes = np.column_stack(columns)
    measured = [m + Observation._fields.index(name) for name in MEASURED]
    last = [m + Observation._fields.index(f"last_torque_{k + 1}") for k in range(COMMANDS)]
    n = m + COMMANDS
    A, B, C = np.zeros((n, n)), np.zeros((n, len(measured))), np.zeros((1, n))
    A[: m + 1] = slopes[:, [*range(m), *last]]
    B[: m + 1] = slopes[:, measured]
    A[m + 1 :, m:-1] = np.eye(COMMANDS - 1)
    C[0, m] = 1.0
    return Half(A, B, C, np.zeros((1, len(measured))))


def settled(controller: Controller, place: Place) -> tuple[Any, Observation]:
    """(State of the law at a place, what it sees there next); the controller has just been reset."""
    state = controller.state()
    if place.point == "centre_stuck":
        return state, place.observation
    way = approach(place)
    torque, state = _driven(controller.law)(state, controller.parameters, way[:-1])
    last = {f"last_torque_{k + 1}": torque for k in range(COMMANDS)}
    return state, Observation(*way[-1].tolist())._replace(**last)


def approach(place: Place) -> Array:
    """Observations [n, 13] on the way to a place; the last is the place's own."""
    end = place.observation
    if place.stuck:
        t = PERIOD * np.arange(round((SWINGING + QUIET) / PERIOD))
        w = 2.0 * np.pi * SWING_Hz
        size = np.where(t < SWINGING, SWING * SWING_KEPT ** (SWING_Hz * t), 0.0)
        angle, rate, acceleration = size * np.sin(w * t), size * w * np.cos(w * t), -size * w * w * np.sin(w * t)
    else:
        t = PERIOD * np.arange(1 - round(SLIDING / PERIOD), 1)
        angle, rate, acceleration = end.pinion_rate * t, np.zeros(t.size), np.zeros(t.size)
    way = np.repeat(np.array(end)[None, :], t.size, axis=0)
    moving = [("pinion_angle", angle), ("pinion_rate", rate), ("pinion_acceleration", acceleration)]
    if place.admittance:
        moving += [("reference", angle), ("reference_rate", rate), ("reference_acceleration", acceleration)]
    for name, values in moving:
        way[:, Observation._fields.index(name)] += values
    return way


@cache
def _driven(law: Law) -> Callable[..., tuple[float, Any]]:
    """A compiled run of the law alone: (last torque, state) after observations [n, 13]."""

    def driven(state: Any, parameters: Any, observations: Array) -> tuple[float, Any]:
        torque = 0.0
        for k in range(observations.shape[0]):
            torque, state = law(_observation(observations[k]), state, parameters)
        return torque, state

    return compiled_with(named(driven, law.__module__, law), law)


def flat(record: Any) -> tuple[list[float], Callable[[list[float]], Any]]:
    """(Numbers of a nested NamedTuple, function that puts such numbers back into its shape)."""
    leaves = [leaf for value in record for leaf in (flat(value)[0] if isinstance(value, tuple) else [float(value)])]

    def rebuild(numbers: list[float]) -> Any:
        supply = iter(numbers)
        return _filled(record, lambda: next(supply))

    return leaves, rebuild


def _filled(record: Any, supply: Callable[[], float]) -> Any:
    """A record of the same shape whose numbers come from ``supply`` one after the other."""
    values = [_filled(v, supply) if isinstance(v, tuple) else supply() for v in record]
    return type(record)(*values)
