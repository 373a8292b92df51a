"""The baseline of the gap study: sparse regression, as one would do it with PySINDy, on the same data and features.

The residual of the nominal fit is regressed on what each nominal parameter and each effect of the catalogue would
change in it, all channels scaled to their own size, by PySINDy's sequentially thresholded least squares. The effect
with the largest coefficient that survives is the answer. No refit, no held-out runs, no physical ranges.
"""

from __future__ import annotations

import numpy as np

from identification.gap.fit import stacked
from identification.gap.result import GapResult
from identification.gap.search import LEAST_ERROR, screen

SEPARABLE = 0.1  # share of a column that no nominal parameter makes
THRESHOLD = 0.1  # of a coefficient, columns and target being of length one: PySINDy's own default


def baseline_name(result: GapResult) -> str:
    """Name that sparse regression gives, "none" where nothing survives the threshold."""
    from pysindy import STLSQ

    judge, null = result.judge, result.search.null
    screened = screen(judge, null, judge.model.effects, np.maximum(null.error, LEAST_ERROR))
    sizes = [np.sqrt(np.nanmean([np.nanmean(m[row] ** 2) for m in judge.measured])) for row in range(len(judge.names))]
    weights = [np.where(np.isnan(m), np.nan, 1.0 / np.array(sizes)[:, None]) for m in judge.measured]
    target = stacked([m - p for m, p in zip(judge.measured, null.solution.predicted, strict=True)], weights)
    nominal = np.column_stack([stacked(column, weights) for column in null.solution.jacobian])
    basis, _ = np.linalg.qr(nominal)
    effects, names = [], []
    for s in screened:
        column = stacked(list(s.direction), weights)
        # What the nominal parameters can do exactly (compliance) would only make the regression singular.
        if np.linalg.norm(column - basis @ (basis.T @ column)) > SEPARABLE * np.linalg.norm(column):
            effects.append(column)
            names.append(s.effect.name)
    columns = [*nominal.T, *effects]
    table = np.column_stack([c / max(float(np.linalg.norm(c)), 1e-300) for c in columns])
    regression = STLSQ(threshold=THRESHOLD, alpha=1e-6)
    regression.fit(table, target[:, None] / max(float(np.linalg.norm(target)), 1e-300))
    coefficients = np.abs(np.asarray(regression.coef_).ravel()[len(null.solution.jacobian) :])
    return names[int(np.argmax(coefficients))] if coefficients.max() > 0.0 else "none"
