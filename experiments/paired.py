"""One controller against another on the same cases: how much closer to the reference it is, and how sure that is.

Cases differ far more from each other than controllers do, so that the intervals of two scores overlap long after one
controller is closer in nearly every case. What tells them apart is the difference on the same cases: plants, cars,
arms and places are drawn anew for both at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

from experiments.bench_protocol import Protocol
from experiments.bench_ranking import score_table

Result = dict[str, Any]
Array = NDArray[np.float64]


class Difference(NamedTuple):
    """Score of a controller minus that of a rival (JND, below 0: closer to the reference), with its interval.

    ``share``: part of the cases in which the controller is the closer one.
    """

    controller: str
    rival: str
    score: float
    interval: tuple[float, float]
    share: float
    cases: int


def differences(
    results: Sequence[Result], pairs: Sequence[tuple[str, str]], protocol: Protocol, seed: int = 0
) -> list[Difference]:
    """The difference of interquartile means for each (controller, rival), intervals by paired bootstrap.

    As in the ranking: draws are drawn anew within their place, or the places where there is one draw of each.
    """
    names, table = score_table(results, protocol)
    places, draws = table.shape[1:]
    rng, resamples = np.random.default_rng(seed), int(protocol.bootstrap["resamples"])
    tail = 0.5 * (1.0 - protocol.bootstrap["coverage"])
    # Few draws per place resample too narrowly by sqrt((n - 1) / n) (Rao and Wu, JASA 83, 1988).
    widened = np.sqrt(draws / (draws - 1.0)) if draws > 1 else 1.0
    again = np.empty((len(names), resamples))
    for k in range(resamples):
        if draws > 1:
            sample = table[:, np.arange(places)[:, None], rng.integers(0, draws, (places, draws))]
        else:
            sample = table[:, rng.integers(0, places, places)]
        again[:, k] = _score(sample)
    scores, found = _score(table), []
    for controller, rival in pairs:
        i, j = names.index(controller), names.index(rival)
        gap = float(scores[i] - scores[j])
        low, high = gap + widened * (np.quantile(again[i] - again[j], [tail, 1.0 - tail]) - gap)
        share = float(np.mean(table[i] < table[j]))
        found.append(Difference(controller, rival, gap, (float(low), float(high)), share, places * draws))
    return found


def _score(table: Array) -> Array:
    """Interquartile means [controller] of scores [controller, place, draw]."""
    means: Array = trim_mean(table.reshape(len(table), -1), 0.25, axis=1)
    return means
