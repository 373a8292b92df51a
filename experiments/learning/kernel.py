"""One step of a policy in many environments, compiled: the base law and ``decimation`` control periods in each.

The same functions of controllers.policy_law run here and in the controller that comes out of training.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from controllers.blocks import Notch
from controllers.policy_law import Memory, relief, remembered, signals_of, smoothed
from experiments.learning.records import nested_loader, nested_storer
from experiments.measures import JND
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.period import control_period
from steer_env.interface import Law, Observation
from steer_env.physics._jit import compiled_with, named, scalar
from steer_env.physics.rows import loader, storer

Array = NDArray[np.float64]

N_OBSERVED = len(Observation._fields)
PART_LIMIT = 10.0  # no part costs more in one period
TORQUE_FLOOR, ANGLE_FLOOR = 0.5, 0.02  # N m and rad: least level of a reference that errors are held against
LEAST_TIME = 1.0  # s over which a level is formed at least
ENERGY_MEMORY, ENERGY_ALLOWANCE = 0.5, 0.01  # s and J, as controllers.passivity has them
PARTS = ("tracking", "smoothness", "passivity", "effort")


class Judged(NamedTuple):
    """What the reward remembers of an episode: periods, sum of squared references, energy (J), angles (rad)."""

    periods: float = 0.0
    square: float = 0.0
    energy: float = 0.0
    angle: float = 0.0
    reference: float = 0.0


class Acting(NamedTuple):
    """What a step needs to know of the policy; names as in controllers.policy_law.PolicyParameters."""

    base: Any
    authority: float
    admittance: float
    keep: float
    rated_torque: float
    schedule: Array
    slope_limit: float
    lag: float
    notch: Notch


class Rows(NamedTuple):
    """Everything that environments [n] hold between steps; arrays are written in place."""

    parameters: Array  # [n, p]
    states: Array  # [n, s]
    lines: Array  # [n, 4, 16]
    base: Array  # [n, b] state of the base law
    memory: Array  # [n, 9]
    judged: Array  # [n, 5]
    observations: Array  # [n, 13], SI
    commands: Array  # [n] the base law's next torque in N m
    left: NDArray[np.int64]  # [n] control periods to the episode's end


_load_memory, _store_memory = loader(Memory, 0), storer(Memory, 0)
_load_judged, _store_judged = loader(Judged, 0), storer(Judged, 0)
_load_observation, _store_observation = loader(Observation, 0), storer(Observation, 0)


@scalar
def judged_after(t: Truth, x: Judged, admittance: float) -> tuple[float, float, Judged]:
    """(Tracking, passivity, what is remembered) after one control period; both are 0 or below.

    The energy that the loop gives to the hand beyond the reference's: torque that is missing times the
    motion (impedance), torque times the motion that is missing (admittance); it leaks.
    """
    floor = ANGLE_FLOOR if admittance > 0.5 else TORQUE_FLOOR
    periods, square = x.periods + 1.0, x.square + t.reference * t.reference
    level = math.sqrt(max(square / max(periods, LEAST_TIME / PERIOD), floor * floor))
    tracking = -min(abs(t.error) / (JND * level), PART_LIMIT)
    moved, wanted = t.pinion_angle - x.angle, t.reference - x.reference
    given = -t.error * moved
    if admittance > 0.5:
        given = t.torsion_bar_torque * (wanted - moved)
    energy = (1.0 - PERIOD / ENERGY_MEMORY) * x.energy + given
    passivity = -min(max(energy / ENERGY_ALLOWANCE - 1.0, 0.0), PART_LIMIT)
    return tracking, passivity, Judged(periods, square, energy, t.pinion_angle, t.reference)


def make_step(law: Law, state: Any) -> tuple[Callable[..., int], Callable[..., None]]:
    """(One step of all, start of some) around a base law whose state is like ``state``.

    step(actions [n], noise [n, decimation, 2], rows, table, car table, Acting, signals [n, 17], parts [n, 4],
    ended [n], unstable [n]) returns how many ended. start(which [m], rows, Acting, signals) prepares the
    first signals after a reset.
    """
    load_base, store_base = nested_loader(state), nested_storer(state)

    def step(
        actions: Array,
        noise: Array,
        rows: Any,
        table: Array,
        car_table: Array,
        p: Any,
        signals: Array,
        parts: Array,
        ended: NDArray[np.bool_],
        unstable: NDArray[np.bool_],
    ) -> int:
        count, decimation = 0, noise.shape[1]
        for i in range(actions.shape[0]):
            memory, judged, base = _load_memory(rows.memory[i]), _load_judged(rows.judged[i]), load_base(rows.base[i])
            o = _load_observation(rows.observations[i])
            command, action = rows.commands[i], actions[i]
            seen = signals_of(o, command, memory, p)
            change = action - memory.action_1
            memory = remembered(memory, seen, action)
            sums, ran, thrown = (0.0, 0.0, 0.0), 0, False
            for j in range(decimation):
                if j > 0:
                    command, base = law(o, base, p.base)
                smooth, memory = smoothed(memory, p)
                o, truth = control_period(
                    command + relief(o, p) * p.authority * smooth, noise[i, j, 0], noise[i, j, 1],
                    rows.parameters[i], rows.states[i], rows.lines[i], table, car_table,
                )  # fmt: skip
                tracking, passivity, judged = judged_after(truth, judged, p.admittance)
                share = truth.command / p.rated_torque
                sums = (sums[0] + tracking, sums[1] + passivity, sums[2] - share * share)
                ran += 1
                rows.left[i] -= 1
                thrown = truth.unstable > 0.5
                if thrown or rows.left[i] <= 0:
                    break
            parts[i, 0], parts[i, 1] = sums[0] / ran, -change * change
            parts[i, 2], parts[i, 3] = sums[1] / ran, sums[2] / ran
            ended[i], unstable[i] = thrown or rows.left[i] <= 0, thrown
            count += ended[i]
            rows.commands[i], base = law(o, base, p.base)
            store_base(rows.base[i], base)
            _store_memory(rows.memory[i], memory)
            _store_judged(rows.judged[i], judged)
            _store_observation(rows.observations[i], o)
            after = signals_of(o, rows.commands[i], memory, p)
            for k in range(len(after)):
                signals[i, k] = after[k]
        return count

    def start(which: NDArray[np.int64], rows: Any, p: Any, signals: Array) -> None:
        for i in which:
            o = _load_observation(rows.observations[i])
            rows.commands[i], base = law(o, load_base(rows.base[i]), p.base)
            store_base(rows.base[i], base)
            first = signals_of(o, rows.commands[i], _load_memory(rows.memory[i]), p)
            for k in range(len(first)):
                signals[i, k] = first[k]

    return compiled_with(named(step, law.__module__, law), law), compiled_with(named(start, law.__module__, law), law)
