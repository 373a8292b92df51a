"""Metrics of the frequency response: angle over torque against the reference's, and the impedance that is felt."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments import measures
from experiments.measures import JND, JND_DB, JND_DEG, Array, log_mean, log_rms
from experiments.metrics_row import CHIRP, FAST_CHIRP, SWEEPS, Metric
from experiments.metrics_trial import BAND_HZ, FAST_BAND_HZ, REQUIRED_BAND_HZ, Compared, Trial


def _magnitude(c: Compared) -> float:
    return log_rms(c.frequency, 20.0 * np.log10(np.abs(c.achieved / c.wanted)))


def _phase(c: Compared) -> float:
    return log_rms(c.frequency, np.degrees(np.angle(c.achieved / c.wanted)))


def _complex(c: Compared) -> float:
    return log_mean(c.frequency, np.abs(c.achieved / c.wanted - 1.0))


def _worst_complex(c: Compared) -> float:
    return _worst(np.abs(c.achieved / c.wanted - 1.0))


def _worst(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else float("nan")


def _transparency(t: Trial, of: Callable[..., float]) -> float:
    c = t.slow_response
    return of(c.frequency, c.wanted / c.achieved)


def _impedance_gap(t: Trial) -> float:
    """Impedance is torque over rate, the responses are angle over torque."""
    f, achieved, wanted = t.slow_response
    s = 2j * np.pi * f
    return measures.passivity_gap(f, 1.0 / (s * achieved), 1.0 / (s * wanted), BAND_HZ)


def _band_rows(
    suffix: str, band: tuple[float, float], manoeuvres: tuple[str, ...], part: Callable[[Trial], Compared]
) -> dict[str, Metric]:
    where = f"{band[0]:g}-{band[1]:g} Hz"
    rows = {
        "frf_magnitude": ("dB", "rms error over log f", _magnitude, 1.0),
        "frf_phase": ("deg", "rms error over log f", _phase, 1.0),
        "frf_complex": ("-", "mean |H - Href| / |Href| over log f", _complex, 1.0),
        "frf_magnitude_jnd": ("JND", "frf_magnitude over 1.2 dB", _magnitude, JND_DB),
        "frf_phase_jnd": ("JND", "frf_phase over 8.6 deg", _phase, JND_DEG),
        "frf_jnd": ("JND", "mean |H - Href| / |Href| over log f, over 15 %", _complex, JND),
        "frf_worst_jnd": ("JND", "largest |H - Href| / |Href|, over 15 %", _worst_complex, JND),
    }

    def row(unit: str, meaning: str, of: Callable[[Compared], float], scale: float) -> Metric:
        return Metric(unit, f"{meaning}, {where}", manoeuvres, lambda t: of(part(t)) / scale)

    return {f"{name}{suffix}": row(*entries) for name, entries in rows.items()}


RESPONSE_ROWS: dict[str, Metric] = {
    **_band_rows("", BAND_HZ, SWEEPS, lambda t: t.slow_response),
    **_band_rows("_fast", FAST_BAND_HZ, FAST_CHIRP, lambda t: t.fast_response),
    "worst_magnitude": Metric("dB", "largest, 0.2-4 Hz", CHIRP, lambda t: _worst(t.error(REQUIRED_BAND_HZ).magnitude)),
    "worst_phase": Metric("deg", "largest, 0.2-4 Hz", CHIRP, lambda t: _worst(t.error(REQUIRED_BAND_HZ).phase)),
    "transparency_bandwidth": Metric(
        "Hz", "end of the band from 0.2 Hz up where felt over wanted impedance is within 1.2 dB", SWEEPS,
        partial(_transparency, of=measures.transparency_bandwidth), "higher",
    ),
    "transparency_error": Metric(
        "-", "mean |ln(felt over wanted impedance)| over log f, 0.2-5 Hz", SWEEPS,
        partial(_transparency, of=measures.transparency_error),
    ),
    "passivity_gap_impedance": Metric(
        "N m s/rad", "least Re(felt minus wanted impedance), 0.2-5 Hz", SWEEPS, _impedance_gap, "higher"
    ),
}  # fmt: skip
