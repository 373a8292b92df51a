"""What a scored case keeps of its signals for a drill-down: few points, few digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.measures import Array
from experiments.metrics import Trial
from experiments.metrics_row import SINES
from experiments.metrics_trial import Compared
from steer_env.envs.layout import PERIOD
from steer_env.units import to_deg

RESPONSE_POINTS = 40
LOOP_POINTS = 60  # per cycle
TRACE_SPANS = 60  # of a trace over time, two points each


def compact_plot(trial: Trial) -> dict[str, Any]:
    """Response (chirp), loop of the last cycle (sines) or traces over time of an episode, beside the ideal."""
    if trial.manoeuvre == "frequency_response":
        return _response(trial.slow_response)
    if trial.manoeuvre == "high_frequency_response":
        return _response(trial.fast_response)
    if trial.manoeuvre in SINES:
        return {name: rounded(values) for name, values in last_cycle(trial, LOOP_POINTS).items()}
    return _trace(trial)


def _response(found: Compared) -> dict[str, Any]:
    f = found.frequency
    if not f.size:
        return {}
    at = np.unique(np.searchsorted(f, np.geomspace(f[0], f[-1], RESPONSE_POINTS)).clip(max=f.size - 1))
    ratio = found.achieved[at] / found.wanted[at]
    return {
        "frequency_Hz": rounded(f[at]),
        "ratio_dB": rounded(20.0 * np.log10(np.abs(ratio))),
        "ratio_deg": rounded(np.degrees(np.angle(ratio))),
    }


def last_cycle(trial: Trial, points: int) -> dict[str, Array]:
    """Loop of the last cycle of a sine, achieved and of the reference, at about so many points."""
    cycle = round(1.0 / trial.episode.part("manoeuvre").frequency / PERIOD)
    step = max(cycle // points, 1)
    found = {}
    for name, of_ideal in (("achieved", False), ("reference", True)):
        angle, torque = trial.loop(of_ideal)
        found[f"{name}_angle_deg"] = np.degrees(angle[-cycle - 1 :: step])
        found[f"{name}_torque_Nm"] = torque[-cycle - 1 :: step]
    return found


def _trace(trial: Trial) -> dict[str, Any]:
    torque = trial.causality == "impedance"
    scale = 1.0 if torque else to_deg(1.0)
    achieved = scale * (trial.achieved[1] if torque else trial.achieved[0])
    reference = scale * trial.episode["reference"]
    time, low_high = envelope(trial.episode["time"], achieved, reference, achieved - reference)
    names = ("achieved", "reference", "error")
    return {
        "time_s": rounded(time),
        "unit": "N m" if torque else "deg",
        **{name: rounded(values) for name, values in zip(names, low_high, strict=True)},
    }


def envelope(time: Array, *signals: Array, spans: int = TRACE_SPANS) -> tuple[Array, list[Array]]:
    """Least and greatest value of each signal [n] in up to so many equal spans, in the order in which they came.

    With their times, evenly spaced: nothing that is faster than the points looks slower, and no peak is lost. The last
    span may lack samples.
    """
    step = max(-(-len(time) // spans), 1)
    found = []
    for values in signals:
        parts = [values[k : k + step] for k in range(0, len(values), step)]
        places = [sorted((int(part.argmin()), int(part.argmax()))) for part in parts]
        found.append(np.array([part[k] for part, pair in zip(parts, places, strict=True) for k in pair]))
    period = (time[-1] - time[0]) / max(len(time) - 1, 1)
    evenly = np.arange(2 * -(-len(time) // step))
    return time[0] + period * (0.5 * step * (0.5 + evenly) - 0.5), found


def rounded(values: Array) -> list[float]:
    """Four digits, which is what a plot can show."""
    return [float(f"{value:.4g}") for value in values]
