"""Scores a controller on the benchmark's training cases: what training may look at, and tuning does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.stats import trim_mean

import controllers
from experiments.bench_cases import Maker
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.tune import scored
from steer_env.interface import Controller
from steer_env.plants import Plant, Reference


class Score(NamedTuple):
    """Interquartile mean and mean of case scores in JND, and how many cases turned unstable."""

    jnd: float
    mean: float
    unstable: int
    cases: int


def training_score(
    make: Maker, plant: str, causality: str, reference: Reference, draws: int = 1, speeds_kmh: Sequence[float] = ()
) -> Score:
    """Every manoeuvre at the speeds (all of the protocol without any), plants and arms from the training seeds."""
    protocol = Protocol.load()
    speeds = tuple(map(float, speeds_kmh or protocol.speeds_kmh))
    once = _once(make)
    results = [
        scored(case, reference, 0, once, protocol)
        for case in protocol.training_cases("", plant, causality, speeds, draws)
    ]
    scores = [case_score(result, protocol) for result in results]
    unstable = sum(not result["stable"] for result in results)
    return Score(float(trim_mean(scores, 0.25)), float(np.mean(scores)), unstable, len(scores))


def classical_scores(
    names: Sequence[str], plant: str, causality: str, reference: Reference, draws: int = 1
) -> dict[str, Score]:
    """The same for rows of CONTROLLERS."""
    return {
        name: training_score(partial(controllers.make, name), plant, causality, reference, draws) for name in names
    }


def _once(make: Maker) -> Callable[[Plant, Reference, str], Controller]:
    """A maker that designs a controller once; episodes reset it."""
    made: list[Controller] = []

    def kept(plant: Plant, reference: Reference, causality: str) -> Controller:
        if not made:
            made.append(make(plant, reference, causality))
        return made[0]

    return kept
