"""How much scores move with the sensors' noise alone, so that a difference can be told from chance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import t, trim_mean

from experiments.bench_cases import SETTLE_S, Case, number_of, scored_result
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import Array, case_score
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.interface import Controller

OTHERS = 9  # further seeds of the noise; with the scored one ten
COVERAGE = 0.95


def noise_scores(case: Case, task: Task, controller: Controller, seed: int) -> list[float]:
    """Simulated scores of a case in JND, the same but for OTHERS other draws of the sensors' noise."""
    protocol, scores = Protocol.load(), []
    for k in range(1, OTHERS + 1):
        drawn = (seed, number_of(case.place))
        episode = run(task, controller, drawn, SETTLE_S, noise_seed=(*drawn, k))
        scores.append(case_score(scored_result(case, episode), protocol))
    return scores


def noise_interval(scores: Sequence[Sequence[float]] | Array) -> tuple[float, float]:
    """Where the interquartile mean of cases lies with one more draw of the noise, in 95 of 100 times.

    ``scores`` [cases, draws] in JND. A prediction interval of a normal distribution from the means of the draws.
    """
    means = trim_mean(np.asarray(scores), 0.25, axis=0)
    n = len(means)
    half = float(t.ppf(0.5 + 0.5 * COVERAGE, n - 1)) * float(means.std(ddof=1)) * math.sqrt(1.0 + 1.0 / n)
    centre = float(means.mean())
    return max(centre - half, 0.0), centre + half
