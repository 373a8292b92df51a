"""Scores of many closed-loop episodes that run side by side in the lanes of a block."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from controllers.schedule import Felt, looked_up, schedules_in
from steer_env.envs.blocks import new_blocks, start_lane
from steer_env.envs.lanes import Switches, switches_of
from steer_env.envs.lanes_rollout import LanesRollout, LookUp, Score, make_lanes_rollout
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Ready
from steer_env.interface import Controller, Law
from steer_env.physics._jit import COMPILED
from steer_env.physics.lanes import WIDTH, flat

Array = NDArray[np.float64]
NOISE_PERIODS = 1000  # drawn at once for each episode of a block: a call for less costs more than its draws


class LanesScorer:
    """Runs a controller on WIDTH episodes of a task at a time."""

    def __init__(self, ready: Ready, controller: Controller, switches: Switches) -> None:
        self.ready = ready
        controller.reset(PERIOD)
        look_up, speed_table = look_up_of(controller.parameters)
        self._law = controller.parameters, speed_table
        self._state = np.array(flat(controller.state()))
        self.rollout = lanes_rollout_of(controller.law, Shape(controller.state()), switches, look_up)
        self._blocks, self._lines = new_blocks(1, self.rollout.size)
        self._noise, self._sums = np.zeros((WIDTH, NOISE_PERIODS, 2)), np.zeros((len(Score._fields), WIDTH))
        self._generators: list[np.random.Generator] = []
        self._tables: tuple[Array, Array] = ready.tables

    def scores(self, seeds: Sequence[int]) -> Array:
        """Scores [WIDTH, fields of Score] of one episode for each of WIDTH seeds."""
        periods = self.start(seeds)
        for first in range(0, periods, NOISE_PERIODS):
            n = min(NOISE_PERIODS, periods - first)
            self.draw_noise(n)
            self.run(n)
        return self._sums.T

    def start(self, seeds: Sequence[int]) -> int:
        """Draw and set up the episodes; how many periods they have."""
        self._generators = [np.random.default_rng(seed) for seed in seeds]
        for lane, rng in enumerate(self._generators):
            setup = self.ready.drawn(rng)
            start_lane(self._blocks, self._lines, lane, setup.row, *self._tables)
        self._blocks[0, self.rollout.state] = self._state[:, None]
        self._sums[:] = 0.0
        return setup.periods

    def draw_noise(self, n: int) -> None:
        """Noise for n periods, each episode's from its own generator."""
        for lane, rng in enumerate(self._generators):
            rng.standard_normal(out=self._noise[lane, :n])

    def run(self, n: int) -> None:
        """N periods with what was drawn last."""
        self.rollout.run(*self._law, self._noise, n, self._blocks[0], self._lines[0], *self._tables, self._sums)


def lanes_scorer(ready: Ready, controller: Any) -> LanesScorer | None:
    """None where lanes cannot run the task or the controller: a step in Python, effects of the catalogue, LuGre."""
    setup = ready.drawn(np.random.default_rng(0))
    switches = switches_of(setup.row, *ready.tables) if setup.effects is None else None
    if switches is None or not COMPILED or not hasattr(controller, "law"):
        return None
    return LanesScorer(ready, controller, switches)


def look_up_of(parameters: Any) -> tuple[LookUp | None, Array | None]:
    """What a law's parameters have over speed, if it is one table, and that table."""
    found = schedules_in(parameters)
    tables = list(found.values())
    if not tables or not all(np.array_equal(table, tables[0]) for table in tables):
        return None, None
    return LookUp(looked_up, Felt, tuple(found)), tables[0]


class Shape:
    """A law's state that stands for all of its shape."""

    def __init__(self, state: Any) -> None:
        self.state = state

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shape) and numba.typeof(self.state) == numba.typeof(other.state)

    def __hash__(self) -> int:
        return hash(numba.typeof(self.state))


@cache
def lanes_rollout_of(law: Law, shape: Shape, switches: Switches, look_up: LookUp | None = None) -> LanesRollout:
    """The compiled episodes of a block around a law; see ``lanes_rollout``."""
    return make_lanes_rollout(law, shape.state, switches, look_up)
