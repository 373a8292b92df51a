"""From case scores to a ranking: interquartile means, bootstrap intervals, ranks with their uncertainty.

A case's score is its distance to the reference in just noticeable differences (JND, 15 %): 1 is what
a driver begins to notice. It ends at the protocol's worst score, which an unstable case gets. The
interquartile mean leaves out the best and worst quarter of cases, so that no single case decides; what
it leaves out is exactly where something dangerous would hide, so safety is a gate beside the score,
never a part of it. Resampling is stratified (draws within each place) and paired (all controllers on the same
places), after R. Agarwal et al., "Deep RL at the edge of the statistical precipice", NeurIPS 2021.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

from experiments.bench_protocol import Protocol

Result = dict[str, Any]
Array = NDArray[np.float64]
BLOCK = 2_000_000  # scores that are drawn at once


class Standing(NamedTuple):
    """One controller's place among those compared; scores in JND, intervals (low, high)."""

    controller: str
    score: float
    score_interval: tuple[float, float]
    rank: int
    rank_interval: tuple[int, int]
    chance_of_best: float
    cases: int
    unstable: int
    safe: bool
    why_unsafe: tuple[str, ...]


def case_score(result: Result, protocol: Protocol) -> float:
    """Score of one case in JND: the mean of the protocol's metrics, each at most the worst score."""
    worst = protocol.worst_score_jnd
    if not result["stable"]:
        return worst
    values = [result["scores"].get(name) for name in protocol.score[result["case"]["manoeuvre"]]]
    known = [min(value, worst) for value in values if value is not None]
    return float(np.mean(known)) if known else worst


def place_of(result: Result) -> tuple[Any, ...]:
    """What is driven, whoever controls it and whichever draw it is."""
    case = result["case"]
    return case["plant"], case["causality"], case["speed_kmh"], case["manoeuvre"], case["arm"]


def score_table(results: Iterable[Result], protocol: Protocol) -> tuple[list[str], Array]:
    """(Controllers, scores [controller, place, draw]) of the scored cases.

    Raises ValueError where a controller lacks a case or a training case stands among them.
    """
    scores: dict[str, dict[tuple[Any, ...], dict[int, float]]] = {}
    for result in results:
        case = result["case"]
        if case["split"] != "test":
            raise ValueError(f"{case['controller']} at {place_of(result)}: only test cases may be scored")
        own = scores.setdefault(case["controller"], {})
        own.setdefault(place_of(result), {})[case["draw"]] = case_score(result, protocol)
    names = list(scores)
    first = scores[names[0]]
    if any(set(own) != set(first) for own in scores.values()):
        raise ValueError("controllers were not driven on the same places")
    table = [[[scores[name][place][k] for k in sorted(first[place])] for place in first] for name in names]
    return names, np.array(table)


def standings(
    results: Sequence[Result], protocol: Protocol, gates: Mapping[str, Sequence[str]], seed: int = 0
) -> list[Standing]:
    """Controllers from best to worst; the unsafe ones (``gates``: why, by name) behind all safe ones."""
    if not results:
        return []
    names, table = score_table(results, protocol)
    means = trim_mean(table.reshape(len(names), -1), 0.25, axis=1)
    again = _resampled(table, int(protocol.bootstrap["resamples"]), np.random.default_rng(seed))
    # Few draws per place resample too narrowly by sqrt((n - 1) / n) (Rao and Wu, JASA 83, 1988).
    draws = table.shape[2]
    again = means[:, None] + np.sqrt(draws / (draws - 1.0) if draws > 1 else 1.0) * (again - means[:, None])
    safe = np.array([not gates.get(name) for name in names])
    ranks = np.array([_ranks(sample, safe) for sample in again.T])
    rank = _ranks(means, safe)
    tail = 0.5 * (1.0 - protocol.bootstrap["coverage"])
    found = []
    for k, name in enumerate(names):
        own = [result for result in results if result["case"]["controller"] == name]
        low, high = np.quantile(again[k], [tail, 1.0 - tail])
        rank_low, rank_high = np.quantile(ranks[:, k], [tail, 1.0 - tail], method="nearest")
        found.append(
            Standing(
                name,
                float(means[k]),
                (float(low), float(high)),
                int(rank[k]),
                (int(rank_low), int(rank_high)),
                float(np.mean(ranks[:, k] == 1)),
                len(own),
                sum(not result["stable"] for result in own),
                bool(safe[k]),
                tuple(gates.get(name, ())),
            )
        )
    return sorted(found, key=lambda standing: standing.rank)


def _resampled(table: Array, resamples: int, rng: np.random.Generator) -> Array:
    """Interquartile means [controller, resample], draws drawn anew within each place, alike for all."""
    n, places, draws = table.shape
    found = np.empty((n, resamples))
    block = max(BLOCK // table.size, 1)
    for start in range(0, resamples, block):
        count = min(block, resamples - start)
        # One draw per place cannot be drawn anew: then the places are.
        if draws > 1:
            drawn = rng.integers(0, draws, (count, places, draws))
            sample = table[:, np.arange(places)[:, None], drawn]
        else:
            sample = table[:, rng.integers(0, places, (count, places))]
        found[:, start : start + count] = trim_mean(sample.reshape(n, count, -1), 0.25, axis=2)
    return found


def _ranks(means: Array, safe: NDArray[np.bool_]) -> NDArray[np.int64]:
    """1 for the best; whoever is not safe comes after all who are."""
    order = np.lexsort((means, ~safe))
    ranks = np.empty(len(means), dtype=np.int64)
    ranks[order] = np.arange(1, len(means) + 1)
    return ranks
