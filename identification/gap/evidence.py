"""How well a solution explains records: model error per channel, likelihood, structure left over.

A model that is nearly right errs by small amounts everywhere (tyre curve, filters, load transfer), coherently and in
all channels. Noise theory would call every such error significant. Here each channel may err, besides its noise, by a
share of its own signal, ``error``: the share is estimated from what the best model leaves over, so it is large where
the model is poor and vanishes where only noise is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identification.frf import Floats
from identification.gap.basis import octave_bands
from identification.gap.fit import Judge

ERRORS = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 31)])


class Blocks(NamedTuple):
    """Per block (record, channel, third of an octave): half the log-likelihood's terms, energies and sizes."""

    record: Floats
    channel: Floats
    loglik: Floats
    energy: Floats
    noise: Floats
    signal: Floats


def residuals(judge: Judge, predicted: Sequence[Floats]) -> list[Floats]:
    """Measured minus predicted coefficients."""
    return [m - p for m, p in zip(judge.measured, predicted, strict=True)]


def error_of(judge: Judge, predicted: Sequence[Floats]) -> Floats:
    """Relative model error [channels] of largest likelihood, given the noise."""
    left = residuals(judge, predicted)
    best = np.zeros(len(judge.names))
    for row in range(len(judge.names)):
        parts = [
            (r[row], n[row], s[row])
            for r, n, s in zip(left, judge.noise_power, judge.signal_power, strict=True)
            if not np.isnan(r[row, 0])
        ]
        if not parts:
            continue
        r, n, s = (np.concatenate(column) for column in zip(*parts, strict=True))
        cost = [float(np.sum(np.log(n + e * e * s) + r * r / (n + e * e * s))) for e in ERRORS]
        best[row] = ERRORS[int(np.argmin(cost))]
    return best


def blocks(judge: Judge, predicted: Sequence[Floats], error: Floats) -> Blocks:
    """Likelihood and energies by block, at a given relative model error [channels]."""
    rows: list[tuple[float, ...]] = []
    for i, (left, variance) in enumerate(zip(residuals(judge, predicted), judge.variance(error), strict=True)):
        index = octave_bands(judge.bands[i].frequency)
        bands, place = np.unique(index, return_inverse=True)
        for row in range(len(judge.names)):
            if np.isnan(left[row, 0]):
                continue
            terms = -0.5 * (np.log(variance[row]) + left[row] ** 2 / variance[row])
            sums = [
                np.bincount(place, weights=w, minlength=bands.size)
                for w in (terms, left[row] ** 2, judge.noise_power[i][row], judge.measured[i][row] ** 2)
            ]
            rows += [(i, row, *values) for values in zip(*sums, strict=True)]
    table = np.array(rows).T
    return Blocks(*table)


def share_explained(before: Blocks, after: Blocks, judge: Judge, floor: float) -> float:
    """Share of the structure of ``before`` that ``after`` has taken away.

    Structure is energy beyond the noise, each channel on the scale of its own signal and noise with ``floor`` as the
    relative error that nobody minds; a channel counts by how much structure it has.
    """
    gone = had = 0.0
    for row in range(len(judge.names)):
        here = before.channel == row
        if not here.any():
            continue
        scale = float(before.noise[here].sum() + floor**2 * before.signal[here].sum())
        first = max(float((before.energy[here] - before.noise[here]).sum()), 0.0) / scale
        last = max(float((after.energy[here] - after.noise[here]).sum()), 0.0) / scale
        had += first
        gone += first - last
    return gone / had if had > 0.0 else 0.0


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
