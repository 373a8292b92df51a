"""Sampled records as band-limited functions of time: shifted, differentiated and resampled without phase error.

A differenced encoder is mostly noise. Every signal that enters the time-domain fits therefore passes the same
zero-phase band limit, flat to a cutoff and closed at a quarter above it, and derivatives are taken inside it. The band
holds the sweep (to 5 Hz) and the harmonics that friction and the assist curve make of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from identification.frf import Complexes, Floats

CUTOFF_HZ = 20.0
PAD_S = 2.0


@dataclass(frozen=True)
class BandLimited:
    """One record of n samples in the frequency domain, with its straight line (start, slope per s) kept apart.

    ``spectrum`` at ``frequency`` in Hz belongs to the record extended by ``pad`` samples to either side.
    """

    spectrum: Complexes
    frequency: Floats
    n: int
    pad: int
    dt: float
    start: float
    slope: float

    def signal(self) -> Floats:
        """Values [n]."""
        return self.fine(1)

    def fine(self, per_sample: int) -> Floats:
        """Values at ``per_sample`` points per sample, [(n - 1) per_sample + 1]."""
        size = (self.spectrum.size - 1) * 2
        wide = np.fft.irfft(self.spectrum, size * per_sample) * per_sample
        first, count = self.pad * per_sample, (self.n - 1) * per_sample + 1
        line = self.start + self.slope * self.dt / per_sample * np.arange(count)
        values: Floats = wide[first : first + count] + line
        return values

    def shifted(self, shift: float) -> BandLimited:
        """The signal at t + shift seconds."""
        turned = self.spectrum * np.exp(2j * np.pi * self.frequency * shift)
        return replace(self, spectrum=turned, start=self.start + self.slope * shift)

    def rate(self) -> BandLimited:
        """The time derivative."""
        return replace(self, spectrum=self.spectrum * (2j * np.pi * self.frequency), start=self.slope, slope=0.0)

    def filtered(self, response: Complexes) -> BandLimited:
        """The output of a linear system with ``response`` at ``frequency``; the straight line sees its first value."""
        static = float(response[0].real)
        return replace(
            self, spectrum=self.spectrum * response, start=self.start * static, slope=self.slope * static
        )


def band_limited(signal: Floats, dt: float, cutoff_Hz: float = CUTOFF_HZ) -> BandLimited:
    """Band-limit a record. Its ends are joined by a straight line and continued by odd reflection, as if resting."""
    n = signal.size
    edge = max(1, round(0.05 / dt))
    first, last = float(signal[:edge].mean()), float(signal[-edge:].mean())
    slope = (last - first) / ((n - 1) * dt)
    rest = signal - first - slope * dt * np.arange(n)
    pad = min(round(PAD_S / dt), n - 1)
    size = n + 2 * pad
    size += size % 2
    extended = np.zeros(size)
    extended[pad : pad + n] = rest
    extended[:pad] = -rest[pad:0:-1]
    extended[pad + n : pad + n + pad] = -rest[-2 : -pad - 2 : -1]
    frequency = np.fft.rfftfreq(size, dt)
    spectrum = np.fft.rfft(extended) * _gain(frequency, cutoff_Hz)
    return BandLimited(spectrum, frequency, n, pad, dt, first, slope)


@dataclass(frozen=True)
class BandFilter:
    """The same band limit for signals made after it, which have new harmonics: zero phase, one second long.

    ``spectrum`` is that of the impulse response of 2 half + 1 samples at a length that holds ``n`` samples and it.
    """

    n: int
    half: int
    length: int
    spectrum: Complexes

    def __call__(self, signal: Floats) -> Floats:
        """The filtered signal [n]; as if it were zero before and after."""
        full = irfft(rfft(signal, self.length) * self.spectrum, self.length)
        kept: Floats = full[self.half : self.half + self.n]
        return kept


def band_filter(n: int, dt: float, cutoff_Hz: float = CUTOFF_HZ) -> BandFilter:
    """The filter for records of ``n`` samples."""
    half = round(0.5 / dt)
    impulse = np.zeros(2 * half + 1)
    impulse[half] = 1.0
    response = band_limited(impulse, dt, cutoff_Hz).signal()
    length = next_fast_len(n + 2 * half, real=True)
    return BandFilter(n, half, length, rfft(response, length))


def _gain(frequency: Floats, cutoff_Hz: float) -> Floats:
    """Flat to the cutoff, then half a cosine to zero at 1.25 times it."""
    x = np.clip((frequency - cutoff_Hz) / (0.25 * cutoff_Hz), 0.0, 1.0)
    gain: Floats = 0.5 + 0.5 * np.cos(np.pi * x)
    return gain
