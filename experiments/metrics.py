"""How well a steering system feels like its reference: METRICS over one closed-loop episode.

Compared are true signals: in impedance the torsion-bar torque with the ideal torque at the true
motion, in admittance the pinion angle with the ideal angle under the true torque (Truth.reference).
To add a metric, write a function of a ``Trial`` and add a row to METRICS; a test gives it a case
whose answer is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from experiments import measures
from experiments.measures import Array, Complexes, ResponseError, rms
from experiments.rollout import Episode
from identification.frf import FrequencyResponse, frequency_response, spectra
from steer_env.envs.layout import PERIOD
from steer_env.physics import linear
from steer_env.units import to_deg

BAND_HZ = (0.2, 5.0)  # FRF scores
REQUIRED_BAND_HZ = (0.2, 4.0)  # where 1.5 dB and 10 deg against the linear reference are asked for
RIPPLE_HZ = 20.0  # what moves faster is ripple, not steering


@dataclass(frozen=True)
class Trial:
    """One episode and what it has to be compared with."""

    episode: Episode
    causality: str
    linear: bool
    manoeuvre: str

    @cached_property
    def achieved(self) -> tuple[Array, Array]:
        """(Pinion angle [n] rad, torsion-bar torque [n] N m) as they were."""
        return self.episode["pinion_angle"], self.episode["torsion_bar_torque"]

    @cached_property
    def ideal(self) -> tuple[Array, Array]:
        """The same, but the one that is tracked replaced by its ideal."""
        angle, torque = self.achieved
        wanted = self.episode["reference"]
        return (angle, wanted) if self.causality == "impedance" else (wanted, torque)

    @cached_property
    def response(self) -> FrequencyResponse:
        """Achieved angle over torque."""
        return response(self.episode["steering_torque"], *self.achieved)

    @cached_property
    def reference_response(self) -> Complexes:
        """Reference at the points of ``response``: Eq. 10 if linear, else from the same run."""
        achieved = self.response
        if not self.linear:
            same = response(self.episode["steering_torque"], *self.ideal)
            return same.all_value[achieved.point]
        return achieved.average(analytic_response(self.episode, achieved.line_frequency))

    def error(self, band: tuple[float, float]) -> ResponseError:
        """Error of the response inside a band in Hz."""
        H = self.response
        return measures.response_error(H.frequency, H.value, self.reference_response, band)

    def loop(self, of_ideal: bool) -> tuple[Array, Array]:
        """(Angle, torque) of a sine manoeuvre after its first cycle."""
        p = self.episode.part("manoeuvre")
        start = round((p.lead_in + 1.0 / p.frequency) / PERIOD)
        end = round((p.lead_in + p.duration) / PERIOD)
        angle, torque = self.ideal if of_ideal else self.achieved
        return angle[start:end], torque[start:end]


@dataclass
class _Recording:
    dt: float
    channels: dict[str, Array]


def response(instrument: Array, angle: Array, torque: Array) -> FrequencyResponse:
    """Angle over torque in rad/(N m) by Eq. 5, the wheel torque as instrument.

    Only points with gamma^2 > 0.72 are kept.
    """
    channels = {
        "steering_torque_Nm": instrument,
        "torsion_bar_torque_Nm": torque,
        "pinion_angle_rad": angle,
    }
    data = spectra([_Recording(PERIOD, channels)], list(channels))
    return frequency_response(data, "steering_torque_Nm", "torsion_bar_torque_Nm", "pinion_angle_rad", "angle / torque")


def analytic_response(episode: Episode, frequency_Hz: Array) -> Complexes:
    """Eq. 10 from torsion-bar torque to pinion angle in rad/(N m), any shape of frequencies."""
    speed = float(episode["speed"][0])
    p = episode.setup.reference.at(speed)
    matrices = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
    values = linear.frequency_response(matrices, frequency_Hz.ravel())[:, 0, 0]
    return values.reshape(frequency_Hz.shape)


def _tracking(t: Trial) -> float:
    error = rms(t.episode["error"])
    return error if t.causality == "impedance" else to_deg(error)


def _relative(t: Trial) -> float:
    reference = rms(t.episode["reference"])
    return rms(t.episode["error"]) / reference if reference > 0.0 else float("nan")


def _magnitude(t: Trial) -> float:
    error = t.error(BAND_HZ)
    return measures.log_rms(error.frequency, error.magnitude)


def _phase(t: Trial) -> float:
    error = t.error(BAND_HZ)
    return measures.log_rms(error.frequency, error.phase)


def _complex(t: Trial) -> float:
    H, reference = t.response, t.reference_response
    inside = (H.frequency >= BAND_HZ[0]) & (H.frequency <= BAND_HZ[1])
    share = np.abs(H.value - reference) / np.abs(reference)
    return measures.log_mean(H.frequency[inside], share[inside])


def _worst(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else float("nan")


def _stiffness(t: Trial, of_ideal: bool) -> float:
    return measures.centre_slope(*t.loop(of_ideal)) / to_deg(1.0)


def _torque_width(t: Trial, of_ideal: bool) -> float:
    angle, torque = t.loop(of_ideal)
    return measures.half_width(angle, torque)


def _angle_width(t: Trial, of_ideal: bool) -> float:
    angle, torque = t.loop(of_ideal)
    return to_deg(measures.half_width(torque, angle))


def _area(t: Trial, of_ideal: bool) -> float:
    angle, torque = t.loop(of_ideal)
    cycles = round(angle.size * PERIOD * t.episode.part("manoeuvre").frequency)
    return measures.loop_area(angle, torque, cycles)


def _saturation(t: Trial) -> float:
    limit = t.episode.part("motor").rated_torque
    return float(np.mean(np.abs(t.episode["command"]) >= 0.999 * limit))


def _ripple(t: Trial) -> float:
    return rms(measures.high_passed(t.episode["torsion_bar_torque"], RIPPLE_HZ, PERIOD))


class Metric(NamedTuple):
    """A row of METRICS: unit, meaning, the manoeuvre it needs ("" for any), its function."""

    unit: str
    meaning: str
    manoeuvre: str
    measure: Callable[[Trial], float]


_CHIRP, _SINE = "frequency_response", "steady_state"
_OURS, _THEIRS = "achieved", "of the reference"

METRICS: dict[str, Metric] = {
    "tracking_error": Metric("N m or deg", "rms error of the tracked signal", "", _tracking),
    "tracking_relative": Metric("-", "that over the rms of the reference", "", _relative),
    "frf_magnitude": Metric("dB", "rms error over log f, 0.2-5 Hz", _CHIRP, _magnitude),
    "frf_phase": Metric("deg", "rms error over log f, 0.2-5 Hz", _CHIRP, _phase),
    "frf_complex": Metric("-", "mean |H - Href| / |Href| over log f", _CHIRP, _complex),
    "worst_magnitude": Metric("dB", "largest, 0.2-4 Hz", _CHIRP, lambda t: _worst(t.error(REQUIRED_BAND_HZ).magnitude)),
    "worst_phase": Metric("deg", "largest, 0.2-4 Hz", _CHIRP, lambda t: _worst(t.error(REQUIRED_BAND_HZ).phase)),
    "torque_hysteresis": Metric("N m", _OURS, _SINE, lambda t: _torque_width(t, False)),
    "torque_hysteresis_reference": Metric("N m", _THEIRS, _SINE, lambda t: _torque_width(t, True)),
    "angle_hysteresis": Metric("deg", _OURS, _SINE, lambda t: _angle_width(t, False)),
    "angle_hysteresis_reference": Metric("deg", _THEIRS, _SINE, lambda t: _angle_width(t, True)),
    "on_centre_stiffness": Metric("N m/deg", _OURS, _SINE, lambda t: _stiffness(t, False)),
    "on_centre_stiffness_reference": Metric("N m/deg", _THEIRS, _SINE, lambda t: _stiffness(t, True)),
    "loop_area": Metric("J", _OURS, _SINE, lambda t: _area(t, False)),
    "loop_area_reference": Metric("J", _THEIRS, _SINE, lambda t: _area(t, True)),
    "effort": Metric("N m", "rms motor torque", "", lambda t: rms(t.episode["motor_torque"])),
    "saturation": Metric("-", "share of time at the motor's torque limit", "", _saturation),
    "ripple": Metric("N m", "rms torsion-bar torque above 20 Hz", "", _ripple),
}


def score(trial: Trial) -> dict[str, float]:
    """Every metric that applies to the trial's manoeuvre, by name."""
    return {
        name: metric.measure(trial) for name, metric in METRICS.items() if metric.manoeuvre in ("", trial.manoeuvre)
    }
