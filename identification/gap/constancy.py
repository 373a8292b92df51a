"""Whether a named effect is the same throughout: early and late in a run, where it is small and where it is large.

A name is a claim about shape. A torque sensor that drifts is not an offset, one that saturates is not a gain, though
either name takes away most of what disagrees. So the effect's amplitude is refitted on halves of the samples, with all
else held: a half that wants much more of it than the other speaks against the name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from identification.frf import Floats
from identification.gap.fit import Judge, present_of
from identification.gap.search import LEAST_ERROR, Candidate
from steer_env.physics.effects import Effect

PROBE = 0.1  # share of the amplitude by which it is changed to see what it does
FLAT = 1.1  # largest over rms of what an effect does up to which "small" and "large" mean nothing
TIME, SIZE = "from the first half of a run to the second", "from where it is small to where it is large"


class Part(NamedTuple):
    """Of one channel of one record: what the effect does [n], what is left [n], and one over what may be left."""

    direction: Floats
    left: Floats
    weight: float


class Change(NamedTuple):
    """By what share of its amplitude an effect grows from one half to the other, and the standard error of that."""

    over: str
    share: float
    error: float


def changes(judges: Sequence[Judge], candidate: Candidate, effect: Effect) -> list[Change]:
    """How an effect of a candidate changes in time within a run, and with its own size."""
    return changes_of([part for judge in judges for part in _parts(judge, candidate, effect)])


def _parts(judge: Judge, candidate: Candidate, effect: Effect) -> Iterator[Part]:
    values, label = candidate.solution.values, f"{effect.name}.{effect.amplitude}"
    absent = float(getattr(effect.absent(), effect.amplitude))
    more = {**values, label: values[label] + PROBE * (values[label] - absent)}
    variances = judge.variance(np.maximum(candidate.error, LEAST_ERROR))
    for record, variance in zip(judge.records, variances, strict=True):
        base, grown = (judge.model.judged(judge.model.simulate(record, v, present_of(v))) for v in (values, more))
        measured = judge.model.judged(record.outputs)
        for row, name in enumerate(judge.names):
            if name in measured:
                direction, left = (grown[name] - base[name]) / PROBE, measured[name] - base[name]
                yield Part(direction[record.keep], left[record.keep], 1.0 / float(np.mean(variance[row])))


def changes_of(parts: Sequence[Part]) -> list[Change]:
    """The changes between halves in time, and between halves by size where the size varies."""
    sums: dict[str, list[tuple[float, ...]]] = {}
    for part in parts:
        for over, first in _halves(part.direction).items():
            d, r = part.direction, part.left
            products = (d[first] @ r[first], d[first] @ d[first], d[~first] @ r[~first], d[~first] @ d[~first])
            sums.setdefault(over, []).append(tuple(part.weight * float(product) for product in products))
    found = [_change(over, np.array(rows)) for over, rows in sums.items()]
    return [change for change in found if change is not None]


def _halves(direction: Floats) -> Mapping[str, NDArray[np.bool_]]:
    """Masks [n] of the first half by each split; the halves by size hold the same energy."""
    found = {TIME: np.arange(direction.size) < direction.size // 2}
    size = np.abs(direction)
    if float(size.max()) > FLAT * float(np.sqrt(np.mean(size**2))) > 0.0:
        order = np.argsort(size, kind="stable")
        energy = np.cumsum(size[order] ** 2)
        small = np.zeros(direction.size, dtype=bool)
        small[order[: int(np.searchsorted(energy, 0.5 * energy[-1]))]] = True
        found[SIZE] = small
    return found


def _change(over: str, rows: Floats) -> Change | None:
    """Second minus first amplitude of all parts [parts, 4] together; its error from leaving out one part at a time."""
    total = rows.sum(axis=0)
    without = (total - rows)[np.all((total - rows)[:, 1::2] > 0.0, axis=1)]
    if min(total[1], total[3]) <= 0.0 or len(without) < 2:
        return None
    each = without[:, 2] / without[:, 3] - without[:, 0] / without[:, 1]
    n = each.size
    error = float(np.sqrt((n - 1.0) / n * np.sum((each - each.mean()) ** 2)))
    return Change(over, float(total[2] / total[3] - total[0] / total[1]), error)
