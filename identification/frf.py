"""Frequency response functions by the instrument method (Eq. 5), with coherence and standard errors.

The robot closes a loop around the steering angle, so Y/U is biased by whatever noise enters the loop. The steering
torque d = M_s is the instrument: H = S_dy / S_du with S averaged over runs and over three neighbouring lines.

Two choices keep the estimate unbiased down to rounding on noise-free data:

- A record that starts and ends at rest is transformed whole, without a window: for a linear system Y = H U then holds
  line by line, whatever the shape of the excitation. A chirp has no leakage to taper away; a taper would only distort
  its two ends, which hold its lowest and its highest frequencies. A constant sensor offset is orthogonal to every line.
  A record that is cut while still moving gets a cosine taper of half a second at its ends instead, after its mean is
  removed.
- Averaging three lines bends a curved H. A model is therefore compared after the same average, with the same weights
  (``FrequencyResponse.average``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Complexes = NDArray[np.complexfloating[Any, Any]]

NEIGHBOURS = 3
MIN_COHERENCE = 0.85  # on gamma itself, Section 3.4.1
BAND_HZ = (0.15, 5.1)  # the sweep of 0.2 to 5 Hz and half a line to either side
MOTION = ("pinion_angle_rad", "yaw_rate_radps")
AT_REST = 0.01  # largest difference between start and end, relative to the range, of a record at rest at its ends
TAPER_S = 0.5


class Recording(Protocol):
    """What is needed of a run: constant step in s, channels [n] by contract name."""

    @property
    def dt(self) -> float:
        """Sampling step in s."""

    @property
    def channels(self) -> Mapping[str, Floats]:
        """Signals [n] by contract name."""


@dataclass(frozen=True)
class Spectra:
    """Discrete Fourier transforms of the runs of one manoeuvre on common lines.

    ``frequency`` [n_lines] in Hz; ``lines`` maps a channel to [n_runs, n_lines], in channel unit times s.
    """

    frequency: Floats
    lines: dict[str, Complexes]


@dataclass(frozen=True)
class FrequencyResponse:
    """One H_uy (Eq. 5) at averaged frequencies [n] in Hz; only points above the coherence limit are kept.

    ``point`` [n] counts the kept points among all; ``value`` [n] complex; ``coherence`` [n] is the smaller of the
    gammas of u and y; ``deviation`` [n_clusters, n] is each run's share of the error of ``value`` (they sum to zero;
    with a single run its three lines stand for runs); ``line_frequency`` and ``line_weight`` [n, 3] are what
    ``average`` needs. ``all_frequency``, ``all_value``, ``all_coherence`` hold every point, for plots.
    """

    name: str
    point: NDArray[np.intp]
    frequency: Floats
    value: Complexes
    coherence: Floats
    deviation: Complexes
    line_frequency: Floats
    line_weight: Complexes
    all_frequency: Floats
    all_value: Complexes
    all_coherence: Floats

    @property
    def magnitude(self) -> Floats:
        """|H| [n]."""
        return np.abs(self.value)

    @property
    def static_gain(self) -> float:
        """|H| at the lowest kept frequency, about 0.2 Hz: the normalisation of Eqs. 8 and 11.

        The sideslip gain passes through zero at some speed and is no scale there, so at least a quarter of the peak.
        """
        if not self.value.size:
            return float("nan")
        return float(max(self.magnitude[0], 0.25 * self.magnitude.max()))

    @property
    def standard_error(self) -> Floats:
        """Standard deviation of the complex value [n], the variance averaged over five neighbouring points."""
        return np.sqrt(smoothed(scatter(self.deviation)))

    def average(self, lines: Complexes) -> Complexes:
        """Average a model's H at ``line_frequency`` [n, 3] exactly as the measured one was averaged: [n]."""
        total: Complexes = (self.line_weight * lines).sum(axis=1) / self.line_weight.sum(axis=1)
        return total

    def below(self, frequency_Hz: float) -> FrequencyResponse:
        """The part below a frequency (the paper's 0.5 Hz for steady-state steps)."""
        keep = self.frequency < frequency_Hz
        return FrequencyResponse(
            self.name, self.point[keep], self.frequency[keep], self.value[keep], self.coherence[keep],
            self.deviation[:, keep], self.line_frequency[keep], self.line_weight[keep],
            self.all_frequency, self.all_value, self.all_coherence,
        )  # fmt: skip


def spectra(
    runs: Sequence[Recording], channels: Sequence[str], band: tuple[float, float] = BAND_HZ
) -> Spectra:
    """Transform the runs of one manoeuvre; records are cut to the shortest so that they share their lines.

    Kept are the lines inside ``band`` in Hz.
    """
    length = min(run.channels[name].size for run in runs for name in channels)
    dt = runs[0].dt
    frequency = np.fft.rfftfreq(length, dt)
    inside = (frequency >= band[0]) & (frequency <= band[1])
    windows = [_window(run, length) for run in runs]
    lines = {
        name: np.array(
            [
                np.fft.rfft(_windowed(run.channels[name][:length], window))[inside] * dt
                for run, window in zip(runs, windows, strict=True)
            ]
        )
        for name in channels
    }
    return Spectra(frequency[inside], lines)


def frequency_response(
    data: Spectra, instrument: str, u: Complexes | str, y: Complexes | str, name: str
) -> FrequencyResponse:
    """H_uy by Eq. 5. ``u`` and ``y`` are channels, or spectra [n_runs, n_lines] made from them (a derivative)."""
    D = groups(data.lines[instrument])
    U = groups(data.lines[u] if isinstance(u, str) else u)
    Y = groups(data.lines[y] if isinstance(y, str) else y)
    frequency = groups(data.frequency[None, :])[0]
    S_du, S_dy = np.conj(D) * U, np.conj(D) * Y
    total = S_du.sum(axis=(0, 2))
    value = S_dy.sum(axis=(0, 2)) / total
    deviation = _deviation(S_dy - value[None, :, None] * S_du) / total
    gamma = np.minimum(coherence(D, U), coherence(D, Y))
    keep = gamma > MIN_COHERENCE
    centre = frequency.mean(axis=1)
    return FrequencyResponse(
        name, np.flatnonzero(keep), centre[keep], value[keep], gamma[keep], deviation[:, keep],
        frequency[keep], S_du.sum(axis=0)[keep], centre, value, gamma,
    )  # fmt: skip


def delayed(lines: Complexes, frequency: Floats, delay: float) -> Complexes:
    """Spectra of a signal that is delayed by ``delay`` s."""
    shifted: Complexes = lines * np.exp(-2j * np.pi * frequency * delay)
    return shifted


def derivative(lines: Complexes, frequency: Floats) -> Complexes:
    """Spectra of the time derivative of a signal that starts and ends at rest."""
    rates: Complexes = lines * (2j * np.pi * frequency)
    return rates


def _window(run: Recording, length: int) -> Floats | None:
    """None where the pinion and the body start and end at rest; one window for all channels otherwise."""
    edge = max(1, round(0.1 / run.dt))
    moving = [
        run.channels[name][:length]
        for name in MOTION
        if name in run.channels
        and _end_step(run.channels[name][:length], edge) > AT_REST * np.ptp(run.channels[name][:length])
    ]
    if not moving:
        return None
    taper = max(2, round(TAPER_S / run.dt))
    window = np.ones(length)
    window[:taper] = 0.5 - 0.5 * np.cos(np.pi * np.arange(taper) / taper)
    window[-taper:] = window[:taper][::-1]
    return window


def _end_step(signal: Floats, edge: int) -> float:
    return abs(float(signal[-edge:].mean() - signal[:edge].mean()))


def _windowed(signal: Floats, window: Floats | None) -> Floats:
    return signal if window is None else (signal - signal.mean()) * window


def groups(lines: NDArray[Any]) -> NDArray[Any]:
    """[n_runs, n_lines] as [n_runs, n_groups, 3] neighbouring lines."""
    n = lines.shape[1] // NEIGHBOURS
    return lines[:, : n * NEIGHBOURS].reshape(lines.shape[0], n, NEIGHBOURS)


def scatter(deviation: Complexes) -> Floats:
    """Variance of a mean from the shares of its clusters in the error, [n_clusters, n] to [n]."""
    n = deviation.shape[0]
    variance: Floats = (np.abs(deviation) ** 2).sum(axis=0) * n / max(n - 1, 1)
    return variance


def smoothed(variance: Floats) -> Floats:
    """Variance [n] averaged over five neighbouring points: few runs tell little about a single one."""
    width = min(5, variance.size)
    if width == 0:
        return variance
    padded = np.pad(variance, (width // 2, (width - 1) // 2), mode="edge")
    mean: Floats = np.convolve(padded, np.ones(width) / width, mode="valid")
    return mean


def coherence(D: Complexes, X: Complexes) -> Floats:
    """Gamma of Eq. 5 [n] from groups [n_runs, n, 3]: over runs and neighbouring lines."""
    cross = np.abs((np.conj(D) * X).sum(axis=(0, 2)))
    power = (np.abs(D) ** 2).sum(axis=(0, 2)) * (np.abs(X) ** 2).sum(axis=(0, 2))
    gamma: Floats = cross / np.sqrt(np.maximum(power, np.finfo(float).tiny))
    return gamma


def _deviation(residual: Complexes) -> Complexes:
    """Residual cross spectra [n_runs, n, 3] summed to clusters: the runs, or the lines when there is one run."""
    per_run: Complexes = residual.sum(axis=2) if residual.shape[0] > 1 else residual[0].T
    return per_run
