"""How well a steering system feels like its reference: METRICS over one closed-loop episode.

Compared are true signals: in impedance the torsion-bar torque with the ideal torque at the true
motion, in admittance the pinion angle with the ideal angle under the true torque (Truth.reference).
The ``felt_`` rows compare torques at the true motion in both, so that the two can be held against
each other. To add a metric, write a function of a ``Trial`` and add a row to METRICS; a test gives
it a case whose answer is known. A metric that an episode cannot tell is NaN; it never raises.

Margins, the radius of coupled stability (experiments.assessment) and the Z-width (experiments.z_width)
are properties of a loop and a set of arms, not of an episode.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments import measures
from experiments.measures import JND, Array, percentile_95, ratio, rms
from experiments.metrics_feel import FEEL_ROWS
from experiments.metrics_response import RESPONSE_ROWS
from experiments.metrics_row import ANY, Metric
from experiments.metrics_trial import BAND_HZ, REQUIRED_BAND_HZ, RIPPLE_HZ, Trial, analytic_response, response
from steer_env.envs.layout import PERIOD
from steer_env.units import to_deg

__all__ = ["BAND_HZ", "METRICS", "REQUIRED_BAND_HZ", "Metric", "Trial", "analytic_response", "response", "score"]

AT_LIMIT = 0.999  # share of a limit that counts as reaching it


def _tracking(t: Trial, of: Callable[[Array], float] = rms) -> float:
    error = of(t.episode["error"])
    return error if t.causality == "impedance" else to_deg(error)


def _relative(t: Trial, of: Callable[[Array], float] = rms) -> float:
    return ratio(of(t.episode["error"]), rms(t.episode["reference"]))


def _felt_error(t: Trial) -> Array:
    return t.episode["torsion_bar_torque"] - t.felt


def _energy_gap(t: Trial) -> float:
    """The port is the lower end of the torsion bar: wheel and bar above it are the same for the reference."""
    return measures.energy_gap(t.episode["torsion_bar_torque"], t.felt, t.episode["pinion_rate"], PERIOD)


def _hand(t: Trial) -> Array:
    return t.episode["steering_torque"][t.held]


def _peak_to_peak(t: Trial) -> float:
    return float(np.ptp(t.ripple)) if t.ripple.size else float("nan")


def _power(t: Trial) -> float:
    shaft_rate = t.episode.part("steering").motor_ratio * t.episode["pinion_rate"]
    return float(np.mean(np.abs(t.episode["motor_torque"] * shaft_rate)))


def _saturation(t: Trial) -> float:
    limit = t.episode.part("motor").rated_torque
    return float(np.mean(np.abs(t.episode["command"]) >= AT_LIMIT * limit))


def _slew_saturation(t: Trial) -> float:
    limit = t.episode.part("motor").slew_rate * PERIOD
    return float(np.mean(np.abs(np.diff(t.episode["command"], prepend=0.0)) >= AT_LIMIT * limit))


METRICS: dict[str, Metric] = {
    "tracking_error": Metric("N m or deg", "rms error of the tracked signal", ANY, _tracking),
    "tracking_relative": Metric("-", "that over the rms of the reference", ANY, _relative),
    "tracking_jnd": Metric("JND", "tracking_relative over 15 %", ANY, lambda t: _relative(t) / JND),
    "tracking_p95": Metric(
        "N m or deg", "95th percentile of the tracked signal's error", ANY, partial(_tracking, of=percentile_95)
    ),
    "tracking_p95_relative": Metric(
        "-", "that over the rms of the reference", ANY, partial(_relative, of=percentile_95)
    ),
    "felt_torque_error": Metric(
        "N m", "rms of torsion-bar torque minus the reference's at the true motion", ANY,
        lambda t: rms(_felt_error(t)),
    ),
    "felt_torque_p95": Metric("N m", "95th percentile of that", ANY, lambda t: percentile_95(_felt_error(t))),
    "felt_torque_jnd": Metric(
        "JND", "felt_torque_error over 15 % of the rms of the reference's torque", ANY,
        lambda t: ratio(rms(_felt_error(t)), JND * rms(t.felt)),
    ),
    **RESPONSE_ROWS,
    **FEEL_ROWS,
    "passivity_gap_energy": Metric(
        "J", "least energy kept beyond what the reference keeps at the same motion", ANY, _energy_gap, "higher"
    ),
    "ripple": Metric("N m", "rms torsion-bar torque above 20 Hz", ANY, lambda t: rms(t.ripple)),
    "ripple_peak_to_peak": Metric("N m", "range of torsion-bar torque above 20 Hz", ANY, _peak_to_peak),
    "hand_ripple": Metric(
        "N m", "rms driver torque above 20 Hz, while he steers", ANY,
        lambda t: rms(measures.high_passed(_hand(t), RIPPLE_HZ, PERIOD)),
    ),
    "jerk": Metric(
        "N m/s", "rms rate of the torsion-bar torque", ANY,
        lambda t: rms(np.diff(t.episode["torsion_bar_torque"]) / PERIOD),
    ),
    "hand_jerk": Metric(
        "N m/s", "rms rate of the driver torque, while he steers", ANY,
        lambda t: rms(np.diff(_hand(t)) / PERIOD),
    ),
    "effort": Metric("N m", "rms motor torque", ANY, lambda t: rms(t.episode["motor_torque"])),
    "motor_power": Metric("W", "mean |motor torque x shaft rate|", ANY, _power),
    "saturation": Metric("-", "share of time at the motor's torque limit", ANY, _saturation),
    "slew_saturation": Metric("-", "share of time at the motor's slew limit", ANY, _slew_saturation),
}  # fmt: skip


def score(trial: Trial) -> dict[str, float]:
    """Every metric that applies to the trial's manoeuvre, by name."""
    return {
        name: metric.measure(trial)
        for name, metric in METRICS.items()
        if not metric.manoeuvres or trial.manoeuvre in metric.manoeuvres
    }
