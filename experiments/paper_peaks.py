"""The two peaks that the paper names (Section 4.1), found on any response of pinion to torque."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from identification.frf import Floats
from steer_env.physics import linear
from steer_env.plants import Reference
from steer_env.units import from_kmh

FIRST_BAND_HZ = (0.5, 2.8)  # angle per torque: the car's yaw motion
SECOND_BAND_HZ = (2.8, 4.95)  # rate per torque: the pinion's own motion
PAPER_Hz = (1.5, 4.0)
PAPER_SPEEDS_KMH = (90.0, 75.0)
WITHIN = 0.15  # "around", "approximately": what we take for agreement, as a share
FINE_HZ = np.geomspace(0.2, 6.0, 2400)
SMOOTHING_HZ = 0.45  # half width of the local parabola that carries a measured magnitude


class Peaks(NamedTuple):
    """Frequencies in Hz; NaN where the magnitude only rises or falls in the band."""

    first: float
    second: float


def closed_form(reference: Reference, speed_kmh: float) -> Peaks:
    """Peaks of Eq. 10 with the linearised assist."""
    speed = from_kmh(speed_kmh)
    p = reference.at(speed)
    H = linear.frequency_response(linear.reference_matrices(speed, p, 1.0 + p.k_gain), FINE_HZ)
    return Peaks(
        summit(FINE_HZ, np.abs(H[:, 0, 0]), FIRST_BAND_HZ),
        summit(FINE_HZ, np.abs(H[:, 1, 0]), SECOND_BAND_HZ),
    )


def measured(
    angle: tuple[Floats, Floats], rate: tuple[Floats, Floats], trusted_to_Hz: float = SECOND_BAND_HZ[1]
) -> Peaks:
    """Peaks of measured responses, each (Hz, magnitude) [n], after smoothing; none beyond ``trusted_to_Hz``."""
    found = []
    for (frequency, magnitude), band in ((angle, FIRST_BAND_HZ), (rate, SECOND_BAND_HZ)):
        f = np.arange(frequency[0], frequency[-1], 0.01)
        inside = (band[0], min(band[1], trusted_to_Hz))
        found.append(summit(f, smoothed(frequency, magnitude, f), inside))
    return Peaks(*found)


def stepped(frequency: Floats, angle: Floats, rate: Floats) -> Peaks:
    """Peaks of magnitudes [n] that are free of noise at some frequencies in Hz: a spline joins them."""
    f = FINE_HZ[(frequency[0] <= FINE_HZ) & (frequency[-1] >= FINE_HZ)]
    joined = [CubicSpline(np.log(frequency), magnitude)(np.log(f)) for magnitude in (angle, rate)]
    return Peaks(summit(f, joined[0], FIRST_BAND_HZ), summit(f, joined[1], SECOND_BAND_HZ))


def summit(frequency: Floats, magnitude: Floats, band: tuple[float, float]) -> float:
    """Frequency in Hz of the largest value that is a maximum inside the band, or NaN."""
    inside = np.flatnonzero((frequency > band[0]) & (frequency < band[1]))
    inside = inside[(inside > 0) & (inside < frequency.size - 1)]
    higher = (magnitude[inside] > magnitude[inside - 1]) & (magnitude[inside] >= magnitude[inside + 1])
    tops = inside[higher]
    return float(frequency[tops[magnitude[tops].argmax()]]) if tops.size else float("nan")


def smoothed(frequency: Floats, magnitude: Floats, at: Floats) -> Floats:
    """Magnitude in dB at ``at``: a parabola through the points within SMOOTHING_HZ of each."""
    decibel = 20.0 * np.log10(magnitude)
    values = np.empty(at.size)
    for k, centre in enumerate(at):
        x = frequency - centre
        near = np.abs(x) < SMOOTHING_HZ
        weight = np.sqrt(1.0 - (x[near] / SMOOTHING_HZ) ** 2)
        values[k] = np.polyfit(x[near], decibel[near], 2, w=weight)[2]
    return values


def agrees(found: float, stated: float) -> bool:
    """Whether a frequency is what the paper calls "around" its own."""
    return abs(found - stated) <= WITHIN * stated
