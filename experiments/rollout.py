"""One closed-loop episode, compiled: a task and a controller in, the true signals out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from experiments.scored_lanes import LanesScorer, lanes_scorer
from steer_env.envs import batch
from steer_env.envs.lanes_rollout import Score
from steer_env.envs.layout import PARAMETERS, PERIOD, Truth
from steer_env.envs.task import Ready, Setup, Task, prepare
from steer_env.interface import Controller, Law, Observation
from steer_env.physics.lanes import WIDTH

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Episode:
    """What happened: ``signals`` [n, fields of Truth] in SI, one row per period of PERIOD s.

    Where the loop turned unstable the episode ends early and ``stable`` is False.
    """

    setup: Setup
    signals: Array
    stable: bool

    def __getitem__(self, name: str) -> Array:
        """One signal [n] by its name in Truth."""
        return self.signals[:, Truth._fields.index(name)]

    def part(self, name: str) -> Any:
        """One record of the parameter row: "motor", "manoeuvre", "driver" ..."""
        return PARAMETERS.read(self.setup.row, name)


def first_observation(setup: Setup) -> Observation:
    """What a controller sees at rest, before the first period."""
    zeros = dict.fromkeys(Observation._fields, 0.0)
    return Observation(**{**zeros, "speed": PARAMETERS.read(setup.row, "episode").speed})


def run(
    task: Task,
    controller: Controller,
    seed: int | Sequence[int] = 0,
    settle: float = 0.0,
    noise_seed: Sequence[int] | None = None,
) -> Episode:
    """Run a task and ``settle`` seconds of rest after it; the same seed gives the same bits.

    The sensors' noise follows from ``seed`` with everything else, or from a ``noise_seed`` of its own.
    A controller without a pure ``law`` is called once per period, which takes some fifty times as long.
    """
    rng = np.random.default_rng(seed)
    setup = prepare(task, rng, PERIOD)
    parameters, states, lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, states, lines, setup.table, setup.car_table)
    periods = setup.periods + round(settle / PERIOD)
    signals = np.zeros((periods, len(Truth._fields)))
    noise = (rng if noise_seed is None else np.random.default_rng(noise_seed)).standard_normal((periods, 2))
    controller.reset(PERIOD)
    if hasattr(controller, "law"):
        rows = (parameters[0], states[0], lines[0], setup.table, setup.car_table)
        start = (controller.state(), controller.parameters, first_observation(setup))
        ran = rollout_of(controller.law)(*start, noise, *rows, signals, setup.effects)
    else:
        ran = _step_by_step(controller, setup, noise, (parameters, states, lines), signals)
    unstable = signals[ran - 1, Truth._fields.index("unstable")] > 0.5
    return Episode(setup, signals[:ran], not unstable)


def scored(task: Task, controller: Controller, seeds: Sequence[int]) -> Array:
    """Scores [n, fields of Score] of one episode for each seed, each the bits of ``run`` with that seed.

    Full blocks of WIDTH episodes run side by side where lanes can run the task; others one after the other.
    """
    scores = np.zeros((len(seeds), len(Score._fields)))
    scorer = lanes_scorer(Ready(task, PERIOD), controller)
    in_lanes = 0 if scorer is None else len(seeds) // WIDTH * WIDTH
    for k in range(0, in_lanes, WIDTH):
        scores[k : k + WIDTH] = cast(LanesScorer, scorer).scores(seeds[k : k + WIDTH])
    for k in range(in_lanes, len(seeds)):
        episode = run(task, controller, seeds[k])
        reward = sum(episode[name] for name in Truth._fields if name.startswith("reward"))
        error = episode["error"]
        # Summed from the first period to the last, as lanes do: np.sum would round otherwise.
        sums = np.cumsum([reward, error * error], axis=1)[:, -1]
        scores[k] = len(error), *sums, not episode.stable
    return scores


def _step_by_step(
    controller: Callable[[Observation], float],
    setup: Setup,
    noise: Array,
    rows: tuple[Array, Array, Array],
    signals: Array,
) -> int:
    """The same episode with the controller in Python: fills ``signals``, returns how many periods ran."""
    seen = np.array([first_observation(setup)])
    scales, scaled, unstable = np.ones(seen.shape), np.zeros(seen.shape, np.float32), Truth._fields.index("unstable")
    for k in range(len(signals)):
        command = np.array([float(controller(Observation(*seen[0].tolist())))])
        tables = (setup.table, setup.car_table)
        results: Any = (seen, scaled, signals[k : k + 1], setup.effects)
        batch.step_batch(command, noise[k : k + 1], *rows, *tables, scales, *results)
        if signals[k, unstable] > 0.5:
            return k + 1
    return len(signals)


@cache
def rollout_of(law: Law) -> Callable[..., int]:
    """The compiled episode around a law; see ``batch.make_rollout``."""
    return batch.make_rollout(law)
