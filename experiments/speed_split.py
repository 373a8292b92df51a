"""Where the time of a whole episode goes: nanoseconds of the processor per control period, phase by phase."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from rich.table import Table

from experiments.scored_lanes import NOISE_PERIODS, LanesScorer, lanes_scorer
from experiments.speed_limit import Proportional
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Ready, Task
from steer_env.physics.lanes import WIDTH

READY, SETUP, NOISE, PERIODS, LAW = (
    "checking the task, once for all",
    "setup of each episode: generator, draws, block",
    "drawing noise",
    "plant, sensors, reference, reward, scores",
    "the law, beside one proportional gain",
)


def split_of(task: Task, controller: Any, blocks: int) -> dict[str, float]:
    """Nanoseconds per period of every phase of ``blocks`` blocks of episodes, run one after the other."""
    clock = _Clock()
    ready = clock.timed(READY, Ready, task, PERIOD)
    scorers = {name: lanes_scorer(ready, law) for name, law in ((PERIODS, Proportional()), (LAW, controller))}
    periods = 0
    for block in range(blocks):
        for name, scorer in scorers.items():
            assert isinstance(scorer, LanesScorer)
            seeds = range(block * WIDTH, (block + 1) * WIDTH)
            left = clock.timed(SETUP, scorer.start, seeds)
            periods += left * WIDTH
            while left > 0:
                n = min(left, NOISE_PERIODS)
                clock.timed(NOISE, scorer.draw_noise, n)
                clock.timed(name, scorer.run, n)
                left -= n
    # Setup and noise were there for both laws, the task once, and the periods with each law for one half.
    found = {name: 1e9 * spent / periods for name, spent in clock.spent.items()}
    found[READY] *= 2.0
    found[PERIODS] *= 2.0
    found[LAW] = 2.0 * found[LAW] - found[PERIODS]
    return {name: found[name] for name in (READY, SETUP, NOISE, PERIODS, LAW)}


class _Clock:
    """Adds up the seconds of the processor that calls take."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}

    def timed(self, name: str, function: Callable[..., Any], *arguments: Any) -> Any:
        start = time.process_time()
        result = function(*arguments)
        self.spent[name] = self.spent.get(name, 0.0) + time.process_time() - start
        return result


def split_table(task: Task, controller: Any, name: str, repeats: int, blocks: int = 2) -> Table:
    """Medians of the repeats, and each phase's share."""
    split_of(task, controller, 1)  # compiles
    runs = [split_of(task, controller, blocks) for _ in range(repeats)]
    phases = {phase: median(run[phase] for run in runs) for phase in runs[0]}
    table = Table("phase", title=f"a whole episode ({task.manoeuvre}) with {name}")
    for heading in ("ns per period", "share"):
        table.add_column(heading, justify="right")
    whole = sum(phases.values())
    for phase, spent in phases.items():
        table.add_row(phase, f"{spent:.1f}", f"{spent / whole:.0%}")
    table.add_row("all", f"{whole:.1f}", "", style="bold")
    return table
