"""What a scored case keeps of its signals for a drill-down: few points, few digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.measures import Array
from experiments.metrics import Trial
from experiments.metrics_trial import Compared
from steer_env.units import to_deg

RESPONSE_POINTS = 40
LOOP_POINTS = 60  # per cycle
TRACE_POINTS = 100
SINES = ("steady_state", "on_centre_weave")


def compact_plot(trial: Trial) -> dict[str, Any]:
    """Response (chirp), loop of the last cycle (sines) or traces over time of an episode, beside the ideal."""
    if trial.manoeuvre == "frequency_response":
        return _response(trial.slow_response)
    if trial.manoeuvre == "high_frequency_response":
        return _response(trial.fast_response)
    return _loop(trial) if trial.manoeuvre in SINES else _trace(trial)


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


def _loop(trial: Trial) -> dict[str, Any]:
    cycle = round(1.0 / trial.episode.part("manoeuvre").frequency / 1e-3)
    step = max(cycle // LOOP_POINTS, 1)
    plot = {}
    for name, of_ideal in (("achieved", False), ("reference", True)):
        angle, torque = trial.loop(of_ideal)
        plot[f"{name}_angle_deg"] = rounded(to_deg(1.0) * angle[-cycle - 1 :: step])
        plot[f"{name}_torque_Nm"] = rounded(torque[-cycle - 1 :: step])
    return plot


def _trace(trial: Trial) -> dict[str, Any]:
    step = max(len(trial.episode.signals) // TRACE_POINTS, 1)
    torque = trial.causality == "impedance"
    scale = 1.0 if torque else to_deg(1.0)
    achieved = trial.achieved[1] if torque else trial.achieved[0]
    return {
        "time_s": rounded(trial.episode["time"][::step]),
        "unit": "N m" if torque else "deg",
        "achieved": rounded(scale * achieved[::step]),
        "reference": rounded(scale * trial.episode["reference"][::step]),
    }


def rounded(values: Array) -> list[float]:
    """Four digits, which is what a plot can show."""
    return [float(f"{value:.4g}") for value in values]
