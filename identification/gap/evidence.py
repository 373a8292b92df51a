"""How well a solution explains records: model error per channel, likelihood, structure left over.

A model that is nearly right errs by small amounts everywhere (tyre curve, filters, load transfer), coherently and in
all channels. Noise theory would call every such error significant. Here each channel may err, besides its noise, by a
share of its own signal, ``error``: the share is estimated from what the best model leaves over, so it is large where
the model is poor and vanishes where only noise is left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identification.frf import Floats
from identification.gap.basis import ZONES_HZ, error_zone, octave_bands
from identification.gap.fit import Judge

ERRORS = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 31)])


def residuals(judge: Judge, predicted: Sequence[Floats]) -> list[Floats]:
    """Measured minus predicted coefficients."""
    return [m - p for m, p in zip(judge.measured, predicted, strict=True)]


def error_of(judge: Judge, predicted: Sequence[Floats]) -> Floats:
    """Relative model error [channels, zones] of largest likelihood, given the noise."""
    left = residuals(judge, predicted)
    best = np.zeros((len(judge.names), len(ZONES_HZ) + 1))
    for row in range(best.shape[0]):
        there = [i for i, r in enumerate(left) if not np.isnan(r[row, 0])]
        for zone in range(best.shape[1]):
            inside = [(i, error_zone(judge.bands[i].frequency) == zone) for i in there]
            r, n, s = (
                np.concatenate([part[i][row, here] for i, here in inside] or [np.zeros(0)])
                for part in (left, judge.noise_power, judge.signal_power)
            )
            if r.size:
                v = n + ERRORS[:, None] ** 2 * s
                best[row, zone] = ERRORS[int(np.argmin(np.sum(np.log(v) + r * r / v, axis=1)))]
    return best


def likelihoods(judge: Judge, predicted: Sequence[Floats], error: Floats) -> Floats:
    """Log-likelihood of each block (record, channel, third of an octave), at a given relative model error."""
    sums: list[Floats] = []
    for i, (left, variance) in enumerate(zip(residuals(judge, predicted), judge.variance(error), strict=True)):
        index = octave_bands(judge.bands[i].frequency)
        _, place = np.unique(index, return_inverse=True)
        for row in range(len(judge.names)):
            if np.isnan(left[row, 0]):
                continue
            terms = -0.5 * (np.log(variance[row]) + left[row] ** 2 / variance[row])
            block: Floats = np.bincount(place, weights=terms).astype(np.float64)
            sums.append(block)
    return np.concatenate(sums)


def fidelity(judge: Judge, before: Sequence[Floats], after: Sequence[Floats], error: Floats) -> float:
    """Where a candidate changes the prediction, the share of what was wrong there that it puts right.

    One: it leaves noise. Zero or less: it moves the prediction, but not towards the measurement. A block counts by
    how much of it the candidate claims to explain, so an effect that shows in one channel is judged in that channel.
    """
    claimed = had = left = 0.0
    rows = zip(judge.measured, before, after, judge.noise_power, judge.variance(error), judge.bands, strict=True)
    for measured, old, new, noise, variance, band in rows:
        _, place = np.unique(octave_bands(band.frequency), return_inverse=True)
        for row in range(len(judge.names)):
            if np.isnan(measured[row, 0]):
                continue
            r, d = measured[row] - old[row], new[row] - old[row]
            was, now, moved, quiet = (
                np.bincount(place, weights=w / variance[row]) for w in (r * r, (r - d) ** 2, d * d, noise[row])
            )
            weight = moved / (moved + was)
            claimed += float(moved.sum())
            had += float((weight * np.maximum(was - quiet, 0.0)).sum())
            left += float((weight * np.maximum(now - quiet, 0.0)).sum())
    return 1.0 - left / had if had > 0.0 and claimed > 0.0 else 0.0


def normalised(judge: Judge, predicted: Sequence[Floats]) -> dict[str, tuple[float, float]]:
    """By channel: (rms of the residual, rms of the noise), both over the rms of the measured signal."""
    left = residuals(judge, predicted)
    found = {}
    for row, name in enumerate(judge.names):
        there = [i for i, r in enumerate(left) if not np.isnan(r[row, 0])]
        if there:
            signal = sum(float(np.sum(judge.measured[i][row] ** 2)) for i in there)
            error = sum(float(np.sum(left[i][row] ** 2)) for i in there)
            noise = sum(float(np.sum(judge.noise_power[i][row])) for i in there)
            found[name] = (float(np.sqrt(error / signal)), float(np.sqrt(noise / signal)))
    return found
