"""Records in frequency: cosine transforms of what is judged, and what noise and model error may make of them.

The cosine transform of a stretch of stationary noise has nearly independent coefficients, and unlike a Fourier
transform it minds no jump between the end and the start. Coefficient k of T seconds belongs to k / 2T hertz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from identification.frf import Floats
from identification.gap.model import Model, Record

BANDS_PER_OCTAVE = 3
# A simple model errs little in slow motion and more the faster it goes (roll, filters, actuators that it leaves out).
ZONES_HZ = (0.35, 2.0)
SPREAD_OCTAVES = 0.5  # over which a model error is let into neighbouring frequencies: a factor of e in power


@dataclass(frozen=True)
class Band:
    """The judged coefficients of a record: ``frequency`` [k] in Hz."""

    keep: slice
    frequency: Floats

    def of(self, signals: Mapping[str, Floats], names: Sequence[str]) -> Floats:
        """Coefficients [channels, k]; not a number in rows whose channel is not there."""
        rows = np.full((len(names), self.frequency.size), np.nan)
        for row, name in enumerate(names):
            if name in signals:
                rows[row] = dct(signals[name][self.keep], norm="ortho")[: self.frequency.size]
        return rows


def band_of(record: Record, band_Hz: float) -> Band:
    """What is judged of a record up to ``band_Hz``."""
    n = record.keep.stop - record.keep.start
    step = 0.5 / (n * record.dt)
    count = min(n, int(min(band_Hz, 0.4 / record.dt) / step) + 1)
    return Band(record.keep, step * np.arange(count))


def octave_bands(frequency: Floats) -> Floats:
    """Index [k] of a logarithmic band for every coefficient, constants with the lowest."""
    lowest = max(float(frequency[1]) if frequency.size > 1 else 1.0, 1e-6)
    index: Floats = np.floor(BANDS_PER_OCTAVE * np.log2(np.maximum(frequency, lowest) / 0.05) + 1e-9)
    return index


def error_zone(frequency: Floats) -> NDArray[np.intp]:
    """Index [k] of the zone, slow, middle or fast, in which a relative model error counts as one number."""
    return np.searchsorted(ZONES_HZ, frequency, side="right")


class NoiseSpectrum:
    """Noise power of each judged channel over frequency, from the deviations of repeats.

    ``from_repeats``: False where no record has repeats; the noise is then taken as white, of the size by which the
    fourth differences of the signals scatter.
    """

    def __init__(self, model: Model, records: Sequence[Record], names: Sequence[str]) -> None:
        self.names = list(names)
        sums: dict[tuple[int, int], list[float]] = {}
        self.from_repeats = any(len(record.repeats) > 1 for record in records)
        for record in records:
            band = band_of(record, model.band_Hz)
            if self.from_repeats and len(record.repeats) < 2:
                continue
            runs = np.array([band.of(model.judged(repeat), names) for repeat in record.repeats])
            freedom = len(runs) - 1 if self.from_repeats else 1
            power = _deviation(runs) if self.from_repeats else _floor(model.judged(record.repeats[0]), band, names)
            index = octave_bands(band.frequency)
            for row in np.flatnonzero(~np.isnan(power[:, 0])):
                for k in np.unique(index):
                    entry = sums.setdefault((int(row), int(k)), [0.0, 0.0])
                    entry[0] += float(power[row, index == k].sum()) * freedom
                    entry[1] += float(np.count_nonzero(index == k)) * freedom
        self._power = {key: total / count for key, (total, count) in sums.items()}

    def at(self, record: Record, frequency: Floats) -> Floats:
        """Power [channels, k] of the noise in the mean of a record's repeats."""
        index = octave_bands(frequency)
        rows = np.full((len(self.names), frequency.size), np.nan)
        for row in range(len(self.names)):
            known = sorted(k for r, k in self._power if r == row)
            if known:
                levels = np.log([max(self._power[row, k], 1e-300) for k in known])
                rows[row] = np.exp(np.interp(index, known, levels))
        return rows / max(len(record.repeats), 1)


def _deviation(runs: Floats) -> Floats:
    """Variance [channels, k] between repeats [repeats, channels, k]."""
    variance: Floats = np.sum((runs - runs.mean(axis=0)) ** 2, axis=0) / (len(runs) - 1.0)
    return variance


def _floor(signals: Mapping[str, Floats], band: Band, names: Sequence[str]) -> Floats:
    """Power [channels, k] of the white noise of signals."""
    rows = np.full((len(names), band.frequency.size), np.nan)
    for row, name in enumerate(names):
        if name in signals:
            rows[row] = white_noise(signals[name][band.keep]) ** 2
    return rows


def white_noise(signal: Floats) -> float:
    """Noise rms of a signal [n], from what its fourth differences scatter by.

    The fourth difference of noise of variance s2 has variance 70 s2; of what was driven hardly anything is left in it.
    Their median, as an impact now and then is no noise; at standstill an encoder shows none.
    """
    scatter = np.abs(np.diff(signal, 4))
    return max(float(np.median(scatter)) / 0.6745, 0.1 * float(np.mean(scatter))) / float(np.sqrt(70.0))


def spread_power(coefficients: Floats, frequency: Floats) -> Floats:
    """Power [channels, k] of a signal, let into neighbouring frequencies as far as a model error may spread it."""
    octave = np.log2(np.maximum(frequency, float(frequency[min(1, frequency.size - 1)])))
    index = np.floor(octave / 0.125).astype(int)
    bins, place = np.unique(index, return_inverse=True)
    count = np.bincount(place).astype(float)
    distance = np.abs(bins[:, None] - bins[None, :]) * 0.125
    kernel = np.exp(-distance / SPREAD_OCTAVES)
    spread = np.empty_like(coefficients)
    for row, values in enumerate(coefficients):
        power = np.bincount(place, weights=np.nan_to_num(values) ** 2)
        density = kernel @ power / (kernel @ count)
        spread[row] = density[place]
    spread[np.isnan(coefficients)] = np.nan
    return spread
