"""Numbers out of signals: pure functions of arrays, each checked against a closed form."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters
from scipy.fft import next_fast_len

Array = NDArray[np.floating[Any]]
Complexes = NDArray[np.complexfloating[Any, Any]]

ON_CENTRE = 0.1  # share of the peak angle that counts as on-centre
GAUSSIAN_REACH = 0.6  # of a low-pass to either side, in periods of its cut-off: 4.5 standard deviations
FILTER_ORDER = 4  # of the high-pass; it runs both ways, which squares its gain
# Just noticeable difference of steering-wheel force and angle, about 15 per cent: Newberry, Griffin, Dowson, Driver
# perception of steering feel, Proc. IMechE D 221 (2007). What a gain of 1.15 is in dB, and the phase whose complex
# error |exp(j phi) - 1| = 2 sin(phi / 2) is as large.
JND = 0.15
JND_DB = 20.0 * math.log10(1.0 + JND)
JND_DEG = math.degrees(2.0 * math.asin(0.5 * JND))


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
    """Root mean square; NaN where there is nothing."""
    return float(np.sqrt(np.mean(signal * signal))) if signal.size else float("nan")


def ratio(value: float, scale: float) -> float:
    """Value over scale; NaN where the scale is zero or unknown."""
    return value / scale if scale > 0.0 else float("nan")


def percentile_95(signal: Array) -> float:
    """What 95 % of |signal| stay below; NaN where there is nothing."""
    return float(np.percentile(np.abs(signal), 95.0)) if signal.size else float("nan")


def high_passed(signal: Array, cut_off_Hz: float, dt: float) -> Array:
    """What a Butterworth filter run both ways leaves above a frequency: gain 1 / (1 + (f_c / f)^8).

    A spectral cut would take a record that ends elsewhere than it began for a jump, and a jump for ripple.
    """
    if signal.size <= 3 * (2 * FILTER_ORDER + 1):  # what the filter pads both ends with
        return np.zeros(0)
    left: Array = filters.sosfiltfilt(_high_pass(cut_off_Hz * dt), signal)
    return left


@cache
def _high_pass(periods_per_sample: float) -> Array:
    sections: Array = filters.butter(FILTER_ORDER, 2.0 * periods_per_sample, "highpass", output="sos")
    return sections


def low_passed(signal: Array, cut_off_Hz: float, dt: float) -> Array:
    """Zero-phase Gaussian low-pass, -3 dB at the frequency: it never rings, so a friction step stays where it is."""
    reach = math.ceil(GAUSSIAN_REACH / (cut_off_Hz * dt))
    padded = np.pad(signal, (reach, reach), mode="edge")
    size = next_fast_len(padded.size, real=True)
    share = np.fft.rfftfreq(size, dt) / cut_off_Hz
    lines = np.fft.rfft(padded, size) * np.exp(-0.5 * math.log(2.0) * share * share)
    return np.fft.irfft(lines, size)[reach : reach + signal.size]


def transparency_bandwidth(frequency: Array, transparency: Complexes) -> float:
    """Upper end in Hz of the band, unbroken from the lowest point, where |20 log10 T| is below one JND.

    T is felt over wanted impedance at frequency [n] in Hz; 0 where the lowest point is outside already.
    """
    if not frequency.size:
        return float("nan")
    outside = np.flatnonzero(np.abs(20.0 * np.log10(np.abs(transparency))) >= JND_DB)
    last = outside[0] - 1 if outside.size else frequency.size - 1
    return float(frequency[last]) if last >= 0 else 0.0


def transparency_error(frequency: Array, transparency: Complexes) -> float:
    """Mean over log frequency of |ln T|, the complex logarithm: magnitude in nepers and phase in rad together."""
    return log_mean(frequency, np.abs(np.log(transparency)))


def passivity_gap(frequency: Array, felt: Complexes, wanted: Complexes, band: tuple[float, float]) -> float:
    """Smallest Re Z_felt - Re Z_wanted in N m s/rad over a band in Hz; negative: more active than the reference.

    Impedances [n] are torque over rate in N m s/rad at frequency [n] in Hz. The reference itself is not passive at
    every speed, so only the difference can be asked to be positive.
    """
    inside = (frequency >= band[0]) & (frequency <= band[1])
    return float((felt.real - wanted.real)[inside].min()) if inside.any() else float("nan")


def energy_gap(felt: Array, wanted: Array, rate: Array, dt: float) -> float:
    """Least in J of the energy taken up since the start beyond what the reference takes up at the same motion.

    Torques [n] in N m act on the port that turns at ``rate`` [n] in rad/s. Zero or below; below: energy came out of
    the port that the reference would have kept.
    """
    power = (felt - wanted) * rate
    taken = np.cumsum(0.5 * (power[1:] + power[:-1])) * dt
    return float(min(taken.min(), 0.0)) if taken.size else float("nan")


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


def centre_slope(x: Array, y: Array, at: float = 0.0) -> float:
    """Mean of the two branches' slopes dy/dx at x = ``at``, fitted where |x - at| < 10 % of the largest.

    NaN where x does not pass through that whole window.
    """
    width = ON_CENTRE * np.abs(x - at).max()
    if x.max() < at + width or x.min() > at - width:
        return float("nan")
    centre = np.abs(x - at) < width
    rising = np.gradient(x) > 0.0
    slopes = [line_slope(x[branch], y[branch]) for branch in (centre & rising, centre & ~rising)]
    return 0.5 * (slopes[0] + slopes[1])


def line_slope(x: Array, y: Array) -> float:
    """Slope dy/dx of the line of least squares; NaN where there are fewer than three points or x does not vary."""
    offset = x - x.mean() if x.size >= 3 else x
    square = float(np.sum(offset * offset))
    if x.size < 3 or square <= 0.0:
        return float("nan")
    return float(np.sum(offset * (y - y.mean()))) / square


def loop_area(x: Array, y: Array, cycles: int) -> float:
    """Area |closed integral of y dx| per cycle of a closed curve that runs through ``cycles``."""
    return abs(float(np.sum(0.5 * (y + np.roll(y, -1)) * (np.roll(x, -1) - x)))) / cycles
