"""The regressors of the drive model over the runs, gathered as Gram matrices of time blocks.

Columns: angle times a hat per speed knot, rate, Dahl friction over its level, then a hat per knot
of each run's bias; the last column is the torque.
"""

import numpy as np

from identification.channels import FloatArray
from identification.drive_fit import TRAVELS, Blocks
from identification.drive_signals import DriveSignals, dahl_shape, hats

RATE_HZ = 20.0  # of the samples that are fitted; the low-pass leaves little above
MAX_BLOCKS, MAX_BIAS_KNOTS = 60, 200  # bounds the work on campaigns of hours
MIN_SHARE = 0.25  # of the mean number of samples: a smaller block joins the one before


def speed_knots(signals: list[DriveSignals], count: int) -> FloatArray:
    """Return speeds [<= count] m/s: 5 % to 95 % quantiles of the sliding samples, 1 m/s apart."""
    speeds = np.concatenate([s.speed[s.sliding] for s in signals])
    knots = np.quantile(speeds, np.linspace(0.05, 0.95, count))
    kept = [knots[0]]
    for knot in knots[1:]:
        if knot - kept[-1] >= 1.0:
            kept.append(knot)
    return np.array(kept) if len(kept) > 1 else np.array([float(np.mean(speeds))])


def bias_times(signals: list[DriveSignals], step: float) -> list[FloatArray]:
    """Return the knots of each run's bias in s, ``step`` apart or wider in very long campaigns."""
    step = max(step, sum(s.time[-1] for s in signals) / MAX_BIAS_KNOTS)
    return [np.linspace(0.0, s.time[-1], max(2, round(s.time[-1] / step) + 1)) for s in signals]


def make_blocks(
    signals: list[DriveSignals], speeds: FloatArray, knots: list[FloatArray], length: float
) -> Blocks:
    """Gather the sliding samples of all runs into blocks of ``length`` seconds or longer."""
    length = max(length, sum(s.time[-1] for s in signals) / MAX_BLOCKS)
    first = len(speeds) + 2
    ends = first + np.cumsum([0, *(len(times) for times in knots)])
    roughness = np.zeros((ends[-1],) * 2)
    grams, samples = [], []
    for s, times, start, end in zip(signals, knots, ends[:-1], ends[1:], strict=True):
        step = np.diff(np.eye(len(times)), axis=0)
        roughness[start:end, start:end] = step.T @ step
        thinning = max(1, int(1.0 / (RATE_HZ * s.time[1])))
        fitted = s.sliding & (np.arange(len(s.time)) % thinning == 0)
        table = np.zeros((np.count_nonzero(fitted), ends[-1] + 1))
        table[:, : first - 2] = hats(s.speed, speeds)[fitted] * s.angle[fitted, None]
        table[:, first - 2] = s.rate[fitted]
        table[:, start:end] = hats(s.time, times)[fitted]
        table[:, -1] = s.torque[fitted]
        shapes = [dahl_shape(s.angle, travel)[fitted] for travel in TRAVELS]
        members = _members(s.time[fitted], length)
        grams.append(_grams(table, first - 1, shapes, members))
        samples += [float(len(member)) for member in members]
    return Blocks(np.concatenate(grams, axis=1), roughness, np.array(samples))


def _members(time: FloatArray, length: float) -> list[np.ndarray]:
    """Sample indices of each block; a block with few samples joins its predecessor."""
    number = (time // length).astype(int)
    members: list[np.ndarray] = []
    least = MIN_SHARE * len(time) / max(1, len(np.unique(number)))
    for k in np.unique(number):
        inside = np.flatnonzero(number == k)
        if members and len(inside) < least:
            members[-1] = np.append(members[-1], inside)
        else:
            members.append(inside)
    return members


def _grams(
    table: FloatArray, column: int, shapes: list[FloatArray], members: list[np.ndarray]
) -> FloatArray:
    """Gram matrices [travels, blocks, p + 1, p + 1] with each friction shape in ``column``."""
    result = np.empty((len(shapes), len(members), table.shape[1], table.shape[1]))
    for index, shape in enumerate(shapes):
        table[:, column] = shape
        for block, member in enumerate(members):
            result[index, block] = table[member].T @ table[member]
    return result
