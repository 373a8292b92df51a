"""The report of a bench: what is on the motor, friction loops, and how well held-out runs are predicted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plotly.graph_objects as go

from experiments.report.figures import Curve, thin, traces
from experiments.report.page import Report
from experiments.report.style import DATA, PALETTE, TEMPLATE
from experiments.report.with_error import with_error
from identification.campaign import Campaign, Run
from identification.rig import RigFit

UNITS = {
    "inertia_kgm2": "kg m2",
    "damping_Nms_per_rad": "N m s/rad",
    "friction_level_Nm": "N m",
    "offset_Nm": "N m",
    "delay_s": "s",
    "friction_stiffness_Nm_per_rad": "N m/rad",
}
KEY = {
    "inertia_kgm2": "inertia, ± standard error",
    "damping_Nms_per_rad": "damping",
    "friction_level_Nm": "friction",
}


def write_rig_report(campaign: Campaign, fit: RigFit, path: str | Path) -> Path:
    """Write the report of a fitted bench as one HTML file and return its path."""
    report = Report(
        f"Rig: {campaign.name}",
        "torque(t − delay) − sensor = J q'' + b q' + friction + offset",
        {"campaign": campaign.name, **{f"sha256 of {k}": v for k, v in campaign.hashes.items()}},
    )
    report.key_numbers(
        [(f"{with_error(fit.params_[name], fit.std_[name])} {UNITS[name]}", text) for name, text in KEY.items()]
    )
    report.section("Parameters").table(
        ["parameter", "unit", "value", "standard error", "95 % from", "to"],
        [[name, unit, fit.params_[name], fit.std_[name], *fit.interval_[name]] for name, unit in UNITS.items()],
        f"Motion up to {fit.band_Hz_:.0f} Hz. Standard errors: jackknife over time blocks. They hold what scatters, "
        "not what the model lacks (cogging, unbalance, a curved torque): 'steer-env gap' looks for that.",
    )
    errors = fit.held_out_
    report.text(
        f"Error over held-out samples: **{errors['model']:.3f} N m** of {errors['torque']:.3f} N m of torque; without "
        f"friction it is {errors['without friction']:.3f} N m."
    )
    chosen = _shown(campaign)
    report.section("Friction loop").figure(
        _loop(fit, next((run for run in chosen if run.manoeuvre == "steady_state"), chosen[0])),
        "What inertia, damping, offset and delay leave of the torque, over the angle, while the motor turns.",
    )
    report.section("Traces")
    for run in chosen:
        report.figure(_traces(fit, run), f"{run.name}, {'held out' if run.role == 'validate' else 'fitted'}.")
    for note in fit.notes_:
        report.text(f"> {note}")
    return report.write(path)


def _shown(campaign: Campaign) -> list[Run]:
    """Held-out runs, or the first few where none is."""
    return [run for run in campaign.runs if run.role == "validate"] or campaign.runs[:3]


def _loop(fit: RigFit, run: Run) -> go.Figure:
    part = fit.components(run)
    angle = run.channels["motor_angle_rad"]
    left = part["measured"] - part["model"] + part["friction"]
    figure = go.Figure()
    for name, values, colour in (("measured", left, DATA), ("Dahl friction", part["friction"], PALETTE[1])):
        shown = np.where(part["sliding"], values, np.nan)
        x, y = thin(angle, shown)
        figure.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 1.0}))
    figure.update_xaxes(title_text="angle [rad]")
    figure.update_yaxes(title_text="torque [N m]")
    return figure.update_layout(template=TEMPLATE, height=380)


def _traces(fit: RigFit, run: Run) -> go.Figure:
    part, angle = fit.components(run), run.channels["motor_angle_rad"]
    t = part["time"]
    residual = np.where(part["sliding"], part["measured"] - part["model"], np.nan)
    panels = {
        "torque [N m]": [Curve(name, t, part[name]) for name in ("measured", "model")],
        "residual, turning [N m]": [Curve("residual", t, residual)],
        "angle [rad]": [Curve("angle", t, angle)],
    }
    return traces(panels)
