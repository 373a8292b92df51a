"""The linear algebra of the drive model: penalised least squares from Gram matrices of time blocks.

With G_b = [X y]'[X y] of block b, any set of blocks is fitted, or scored, without the data. The
bias is a random walk: neighbouring knots are drawn together by ``penalty`` times their squared
difference. Standard errors are the jackknife's over blocks: it asks nothing of the residual within
a block, so coloured residuals (seconds long in a car) are accounted for; blocks must be longer.
"""

from dataclasses import dataclass

import numpy as np

from identification.channels import FloatArray

TRAVELS = np.geomspace(3e-4, 5e-2, 25)  # rad: M_C / c_fric, 0.02 to 3 deg
PENALTIES = np.geomspace(0.03, 3e4, 13)
FOLDS = 5


@dataclass(frozen=True)
class Blocks:
    """Gram matrices [travels, blocks, p + 1, p + 1] and the roughness matrix [p, p] of the bias."""

    grams: FloatArray
    roughness: FloatArray
    samples: FloatArray  # [blocks]


@dataclass(frozen=True)
class Estimate:
    """Coefficients [p], the Dahl travel in rad, its nearest grid index, and the sum of squares."""

    theta: FloatArray
    travel: float
    index: int
    rss: float


def solve(gram: FloatArray, roughness: FloatArray, penalty: float) -> tuple[FloatArray, float]:
    """Return the coefficients [p] and the penalised sum of squares of one Gram matrix."""
    normal = gram[:-1, :-1] + penalty * roughness
    # A trace of ridge: a bias knot without samples near it must not make this singular.
    ridge = 1e-9 * np.trace(normal) / len(normal)
    theta = np.linalg.solve(normal + ridge * np.eye(len(normal)), gram[:-1, -1])
    return theta, float(gram[-1, -1] - gram[:-1, -1] @ theta)


def residual(gram: FloatArray, theta: FloatArray) -> float:
    """Return the sum of squared residuals of a block for given coefficients."""
    z = np.append(theta, -1.0)
    return float(z @ gram @ z)


def estimate(blocks: Blocks, used: np.ndarray, penalty: float) -> Estimate:
    """Fit the blocks in ``used`` [blocks] bool; the Dahl travel is that of least cost."""
    grams = [travel_grams[used].sum(axis=0) for travel_grams in blocks.grams]
    fits = [solve(gram, blocks.roughness, penalty) for gram in grams]
    costs = np.array([cost for _, cost in fits])
    index = int(np.argmin(costs))
    theta = fits[index][0]
    return Estimate(theta, _refined(costs, index), index, residual(grams[index], theta))


def _refined(costs: FloatArray, index: int) -> float:
    """Return the travel at the minimum of a parabola through the best three, on a log scale."""
    if not 0 < index < len(costs) - 1:
        return float(TRAVELS[index])
    before, here, after = costs[index - 1 : index + 2]
    curvature = before - 2.0 * here + after
    shift = 0.5 * (before - after) / curvature if curvature > 0.0 else 0.0
    return float(TRAVELS[index] * (TRAVELS[1] / TRAVELS[0]) ** shift)


def held_out(blocks: Blocks, penalty: float, columns: np.ndarray | None = None) -> float:
    """Return the rms error in N m over blocks left out in turn, every ``FOLDS``-th together.

    ``columns`` [p] bool keeps only these regressors: a smaller model under the same test.
    """
    keep = np.append(columns if columns is not None else np.ones(len(blocks.roughness), bool), True)
    smaller = Blocks(
        blocks.grams[:, :, keep][:, :, :, keep],
        blocks.roughness[np.ix_(keep[:-1], keep[:-1])],
        blocks.samples,
    )
    fold = np.arange(len(blocks.samples)) % FOLDS
    total = 0.0
    for k in range(FOLDS):
        fit = estimate(smaller, fold != k, penalty)
        total += residual(smaller.grams[fit.index][fold == k].sum(axis=0), fit.theta)
    return float(np.sqrt(max(total, 0.0) / blocks.samples.sum()))


def best_penalty(blocks: Blocks) -> float:
    """Return the penalty whose bias predicts held-out blocks best."""
    return float(min(PENALTIES, key=lambda penalty: held_out(blocks, penalty)))


def jackknife(blocks: Blocks, penalty: float) -> list[Estimate]:
    """Return the estimates with each block left out in turn."""
    everything = np.arange(len(blocks.samples))
    return [estimate(blocks, everything != left_out, penalty) for left_out in everything]


def standard_error(replicates: FloatArray) -> FloatArray:
    """Return the jackknife standard error over the first axis."""
    count = len(replicates)
    spread: FloatArray = np.sqrt((count - 1) * np.mean((replicates - replicates.mean(0)) ** 2, 0))
    return spread
