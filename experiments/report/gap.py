"""The report of the gap workflow: enough pictures to judge whether to believe the verdict."""

from __future__ import annotations

from html import escape
from pathlib import Path

from experiments.report import gap_figures as figures
from experiments.report.page import Report
from identification.campaign import Campaign
from identification.gap.result import GapResult
from identification.gap.vehicle_model import VehicleModel

WORDS = {"effect": "missing effect found", "none": "nothing is missing", "unknown": "something is missing, not known"}
SYMPTOMS_SHOWN = 12


def write_gap_report(campaign: Campaign, result: GapResult, path: str | Path) -> Path:
    """Write the report of a gap analysis as one HTML file and return its path."""
    report = Report(
        f"Gap: {campaign.name}",
        WORDS[result.verdict],
        {"campaign": campaign.name, "runs": len(campaign.runs)},
    )
    _verdict(report, result)
    _before_and_after(report, result)
    _ranking(report, result)
    _symptoms(report, result)
    _doubt(report, result)
    _model(report, result)
    return report.write(path)


def _verdict(report: Report, result: GapResult) -> None:
    before, after, noise = (result.total(k) for k in ("before", "after", "noise"))
    names = " + ".join(e.name for e in result.effects) or {"none": "nothing", "unknown": "unknown"}[result.verdict]
    report.key_numbers(
        [
            (names.replace("_", "_\u200b"), "missing in the nominal model"),
            (f"{before:.3f} → {after:.3f}", "held-out error over signal, before and after"),
            (f"{noise:.3f}", "noise over signal: the floor"),
            *((f"{e.probability:.0%}", f"probability of {e.name}") for e in result.effects),
        ]
    )
    report.text(f"> {escape(result.reason)}.")
    if result.effects:
        report.table(
            ("effect", "parameter", "value", "95 % from", "to"),
            [[e.name, name, p.value, p.low, p.high] for e in result.effects for name, p in e.parameters.items()],
            "Parameters, fitted jointly with the nominal model.",
        )


def _before_and_after(report: Report, result: GapResult) -> None:
    report.section("Before and after on held-out runs").text(
        "None of these runs was fitted. The nominal model (before) and the model with what was found (after) are led "
        "by the measured steering angle alone."
        if result.kind == "vehicle"
        else "None of these stretches was fitted."
    )
    report.figure(figures.channel_gaps(result), "Held-out error over the rms of the signal, by channel.")
    worst = figures.channels_by_gain(result)
    for name in worst[:2]:
        report.figure(figures.time_traces(result, name), f"{name} in time; below, the residuals.")
    report.figure(figures.loops(result, worst[0]), f"{worst[0]} over the lead angle: what a person would feel.")
    frf = figures.responses(result, worst[0])
    if frf is not None:
        report.figure(frf, f"Frequency response of {worst[0]} to the steering angle in held-out sweeps.")
    report.figure(figures.spectra(result, worst[:3]), "Residuals over frequency, with the noise.")
    report.figure(
        figures.residual_map(result, worst[0]),
        f"Mean residual of {worst[0]} over angle and rate: structure before, none after, if the name is right.",
    )


def _ranking(report: Report, result: GapResult) -> None:
    report.section("Candidates").text(
        "Each candidate was refitted together with all nominal parameters. *Puts right* is the share of the held-out "
        "disagreement that a candidate removes where it changes the prediction: 1 for the true effect, little for one "
        "that only bends the model. *z* is its held-out gain over the scatter between blocks."
    )
    report.figure(figures.ranking(result), "What each candidate puts right against how sure its gain is.")
    for title, tried in (("alone", result.search.singles), ("beside the first", result.search.pairs)):
        if tried:
            report.table(
                ("candidate", "delta BIC", "held-out z", "puts right", "error after", "in its physical range"),
                [
                    [j.name, j.delta_bic, j.z, j.fidelity, j.gap_after, "yes" if j.in_range else "no"]
                    for j in tried
                ],
                f"Candidates {title}, strongest first.",
            )


def _symptoms(report: Report, result: GapResult) -> None:
    report.section("Symptoms").text("Where the nominal model disagrees, before anything is named.")
    if not result.symptoms:
        report.text("None: the residual of the fitted runs is noise.")
        return
    report.table(
        ("where", "what", "strength"),
        [[s.where, s.what, s.strength] for s in result.symptoms[:SYMPTOMS_SHOWN]],
        "Strength in standard errors, or in noise units for a size.",
    )


def _doubt(report: Report, result: GapResult) -> None:
    report.section("Doubt and advice")
    if result.ambiguous_with:
        report.text(f"These data do not tell it apart from: {', '.join(result.ambiguous_with)}.")
    elif result.effects:
        report.text("No other candidate explains nearly as much.")
    if result.advice is not None:
        drive = f"{result.advice.manoeuvre} at {result.advice.speed_kmh:g} km/h"
        report.text(f"**Drive next:** {drive}; {escape(result.advice_why)}.")
    source = "from the deviations of repeats" if result.noise_from_repeats else "of the sensors alone, without repeats"
    report.text(f"Noise: {source}. The model error allowed for, by channel and frequency, is estimated from the rest.")
    for note in result.notes:
        report.text(f"- {escape(note)}")


def _model(report: Report, result: GapResult) -> None:
    report.section("Model")
    solution = result.search.best.solution
    rows = []
    for unknown in solution.unknowns:
        low, high = solution.interval(unknown.name)
        rows.append([unknown.name, solution.values[unknown.name], low, high])
    report.table(("parameter", "value", "95 % from", "to"), rows, "The extended model; name@speed in km/h.", dense=True)
    if isinstance(result.judge.model, VehicleModel):
        report.text("`model.json` beside this page loads in `gymnasium.make(..., model=\"model.json\")`.")
