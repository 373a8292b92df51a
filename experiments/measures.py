"""Numbers out of signals: pure functions of arrays, each checked against a closed form."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Complexes = NDArray[np.complexfloating[Any, Any]]

ON_CENTRE = 0.1  # share of the peak angle that counts as on-centre


class ResponseError(NamedTuple):
    """Error of a frequency response at frequency [n] in Hz: magnitude [n] dB, phase [n] deg."""

    frequency: Array
    magnitude: Array
    phase: Array


def response_error(
    frequency: Array, achieved: Complexes, reference: Complexes, band: tuple[float, float]
) -> ResponseError:
    """20 log10 |H / H_ref| and arg(H / H_ref) inside a band in Hz."""
    inside = (frequency >= band[0]) & (frequency <= band[1])
    ratio = achieved[inside] / reference[inside]
    magnitude = 20.0 * np.log10(np.abs(ratio))
    return ResponseError(frequency[inside], magnitude, np.degrees(np.angle(ratio)))


def log_mean(frequency: Array, values: Array) -> float:
    """Mean over log frequency of values at evenly spaced frequencies: points weigh 1/f."""
    if not values.size:
        return float("nan")
    return float(np.sum(values / frequency) / np.sum(1.0 / frequency))


def log_rms(frequency: Array, values: Array) -> float:
    """Root mean square over log frequency."""
    return float(np.sqrt(log_mean(frequency, values * values)))


def rms(signal: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(signal * signal)))


def high_passed(signal: Array, cut_off_Hz: float, dt: float) -> Array:
    """What a zero-phase spectral cut leaves above a frequency."""
    lines = np.fft.rfft(signal - signal.mean())
    lines[np.fft.rfftfreq(signal.size, dt) < cut_off_Hz] = 0.0
    return np.fft.irfft(lines, signal.size)


def crossings(x: Array, y: Array, rising: bool) -> Array:
    """Values of y where x passes zero upwards (or downwards), one per passage, straight between samples.

    A passage leads from beyond the on-centre region on one side to beyond it on the other; where noise makes x change
    its sign several times on the way, the mean of those places counts, so that noise cannot mix the two branches.
    """
    sign = x if rising else -x
    outside = np.flatnonzero(np.abs(x) >= ON_CENTRE * np.abs(x).max())
    passing = np.flatnonzero((sign[outside[:-1]] < 0.0) & (sign[outside[1:]] > 0.0))
    found = []
    for start, end in zip(outside[passing], outside[passing + 1], strict=True):
        inside = slice(start, end + 1)
        at = start + np.flatnonzero(np.signbit(sign[inside][:-1]) != np.signbit(sign[inside][1:]))
        share = x[at] / (x[at] - x[at + 1])
        found.append(float(np.mean(y[at] + share * (y[at + 1] - y[at]))))
    return np.array(found)


def half_width(x: Array, y: Array) -> float:
    """Half the separation of the two branches of y at x = 0, mean over the cycles given."""
    up, down = crossings(x, y, True), crossings(x, y, False)
    if not up.size or not down.size:
        return float("nan")
    return 0.5 * abs(float(up.mean() - down.mean()))


def centre_slope(x: Array, y: Array) -> float:
    """Mean of the two branches' slopes dy/dx at x = 0, fitted where |x| < 10 % of its peak."""
    centre = np.abs(x) < ON_CENTRE * np.abs(x).max()
    rising = np.gradient(x) > 0.0
    slopes = [_slope(x[branch], y[branch]) for branch in (centre & rising, centre & ~rising)]
    return 0.5 * (slopes[0] + slopes[1])


def _slope(x: Array, y: Array) -> float:
    if x.size < 3:
        return float("nan")
    offset = x - x.mean()
    return float(np.sum(offset * (y - y.mean())) / np.sum(offset * offset))


def loop_area(x: Array, y: Array, cycles: int) -> float:
    """Area |closed integral of y dx| per cycle of a closed curve that runs through ``cycles``."""
    return abs(float(np.sum(0.5 * (y + np.roll(y, -1)) * (np.roll(x, -1) - x)))) / cycles
