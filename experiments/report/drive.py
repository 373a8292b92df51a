"""The report of a drive: loops beside fitted loops, stiffness over speed, and what to trust."""

from html import escape
from pathlib import Path

import numpy as np

from experiments.report.drive_figures import (
    LONGEST_TRACE,
    drive_traces,
    loops,
    stiffness_over_speed,
)
from experiments.report.page import Report
from identification.campaign import Campaign
from identification.drive import DriveModel
from steer_env.units import to_kmh

UNITS = {
    "stiffness_Nm_per_rad": "N m/rad",
    "damping_Nms_per_rad": "N m s/rad",
    "friction_level_Nm": "N m",
    "friction_stiffness_Nm_per_rad": "N m/rad",
}


def write_drive_report(campaign: Campaign, model: DriveModel, path: str | Path) -> Path:
    """Write the report of a fitted drive as one HTML file and return its path."""
    report = Report(
        f"Drive: {campaign.name}",
        "steering torque = c(v) angle + b rate + friction + bias",
        {"campaign": campaign.name, **{f"sha256 of {k}": v for k, v in campaign.hashes.items()}},
    )
    add_drive(report, campaign, model)
    return report.write(path)


def add_drive(report: Report, campaign: Campaign, model: DriveModel) -> None:
    """Add the sections of a fitted drive to a report."""
    runs = [run for run in campaign.runs if run.name in model.bias_]
    parts = [model.components(run) for run in runs]
    report.key_numbers(_key_numbers(model))
    report.section("Loops").text(
        "While the wheel slides, friction shows its whole level; while it rests, friction holds "
        "any torque within that level, and the angle says nothing of it. The fit therefore uses "
        f"sliding samples only, above {model.sliding_rate:g} rad/s. Half of a loop's vertical "
        "width is the friction level plus the damping."
    )
    report.figure(loops(parts, model.speeds_), "Torque without the bias over angle, by speed.")
    report.section("Parameters").table(
        ["parameter", "unit", "value", "standard error", "95 % from", "to"],
        _parameter_rows(model),
        "Standard errors: jackknife over time blocks, so residuals may be coloured.",
    )
    report.figure(stiffness_over_speed(model), "Centring stiffness c(v) with 95 % intervals.")
    report.section("What to trust")
    _add_trust(report, campaign, model)
    report.section("Traces")
    for run, part in zip(runs, parts, strict=True):
        report.figure(drive_traces(part), f"{run.name}, first {LONGEST_TRACE:g} s.")


def _add_trust(report: Report, campaign: Campaign, model: DriveModel) -> None:
    rows = [(name, value) for name, value in model.held_out_.items()]
    report.table(
        ["model", "rms error on blocks left out [N m]"],
        rows,
        "Every fifth time block left out in turn; the bias is carried over from its neighbours. "
        "The pace of the bias was chosen by this score, which flatters it a little.",
    )
    rates = [factor * model.sliding_rate for factor in (0.5, 1.0, 2.0)]
    report.table(
        ["sliding above [rad/s]", "friction level [N m]", "damping [N m s/rad]"],
        [_at_rate(campaign, model, rate) for rate in rates],
        "A level that moves with the threshold is not one number: friction then depends on rate.",
    )
    report.text(
        f"At rest, friction held up to {model.rest_:.2f} N m (95 % of the resting samples, which "
        "the fit did not use); the fitted level is "
        f"{model.params_['friction_level_Nm']:.2f} N m. The bias (road crown, side wind, sensor) "
        "is a random walk between knots, not a measurement of any of them."
    )
    for note in model.notes_:
        report.text(f"> {escape(note)}")


def _at_rate(campaign: Campaign, model: DriveModel, rate: float) -> list[object]:
    arguments = {
        name: getattr(model, name) for name in ("speed_knots", "bias_step", "block", "cutoff_Hz")
    }
    other = model
    if rate != model.sliding_rate:
        other = DriveModel(**arguments, sliding_rate=rate).fit(campaign)
    return [
        rate,
        _plus_minus(other, "friction_level_Nm"),
        _plus_minus(other, "damping_Nms_per_rad"),
    ]


def _plus_minus(model: DriveModel, name: str) -> str:
    return f"{model.params_[name]:.3f} ± {model.std_[name]:.3f}"


def _key_numbers(model: DriveModel) -> list[tuple[str, str]]:
    low, high = model.interval_["friction_level_Nm"]
    return [
        (
            f"{model.params_['friction_level_Nm']:.2f} N m",
            f"friction, 95 %: {low:.2f} to {high:.2f}",
        ),
        (f"{_plus_minus(model, 'damping_Nms_per_rad')} N m s/rad", "damping, ± standard error"),
        (
            f"{model.params_['stiffness_Nm_per_rad'][-1]:.1f} N m/rad",
            f"stiffness at {to_kmh(float(model.speeds_[-1])):.0f} km/h",
        ),
    ]


def _parameter_rows(model: DriveModel) -> list[list[object]]:
    rows: list[list[object]] = []
    for name, unit in UNITS.items():
        values = np.atleast_1d(model.params_[name])
        errors = np.atleast_1d(model.std_[name])
        low, high = (np.atleast_1d(side) for side in model.interval_[name])
        label = name.rpartition("_N")[0].replace("_", " ")
        for k, value in enumerate(values):
            at = f" at {to_kmh(float(model.speeds_[k])):.0f} km/h" if len(values) > 1 else ""
            rows.append([label + at, unit, value, errors[k], low[k], high[k]])
    return rows
