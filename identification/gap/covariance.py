"""How sure a solution is when its residual is model error and not noise."""

from __future__ import annotations

import numpy as np

from identification.frf import Floats
from identification.gap.basis import error_zone
from identification.gap.fit import Judge, Solution, body_of, weights_of


def clustered_covariance(judge: Judge, solution: Solution, error: Floats) -> Floats:
    """Covariance of a solution whose residual is coherent within a record, channel and zone of frequency.

    Model error is: it has one sign over a whole manoeuvre. The larger of this and what independent errors give.
    """
    weights = weights_of(judge, error)
    body = body_of(solution.jacobian, weights)
    prior = 1.0 / np.array([u.prior for u in solution.unknowns]) ** 2
    inverse = np.linalg.pinv(body.T @ body + np.diag(prior), hermitian=True)
    clusters = []
    for measured, predicted, weight, band in zip(
        judge.measured, solution.predicted, weights, judge.bands, strict=True
    ):
        there = ~np.isnan(weight)
        zone = np.broadcast_to(error_zone(band.frequency), weight.shape)[there]
        row = np.broadcast_to(np.arange(weight.shape[0])[:, None], weight.shape)[there]
        clusters.append((row * 10 + zone, ((measured - predicted) * weight)[there]))
    scores, start = [], 0
    for place, left in clusters:
        part = body[start : start + left.size] * left[:, None]
        scores += [part[place == k].sum(axis=0) for k in np.unique(place)]
        start += left.size
    table = np.array(scores)
    coherent = inverse @ (table.T @ table) @ inverse
    larger = np.sqrt(np.maximum(np.diag(coherent) / np.maximum(np.diag(inverse), 1e-300), 1.0))
    scaled: Floats = inverse * np.outer(larger, larger)
    return scaled
