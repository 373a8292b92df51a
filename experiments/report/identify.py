"""The report of an identification, in the order of the paper's Figures 5 to 8 and Tables 2 and 3."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path

import numpy as np

from experiments.report import identify_figures as figures
from experiments.report.page import Report
from experiments.report.with_error import with_error
from identification.campaign import Campaign
from identification.result import KEYS, Identification, SpeedResult, disagreement
from steer_env.plants.reference_row import ReferenceRow
from steer_env.units import quantities

VEHICLE = ("C_f", "C_r", "n_t", "J_z", "sigma_f", "sigma_r")
STEERING = ("J_ref", "b_ref", "k_gain", "c_pin_on", "c_pin_off", "sigma_assist", "M_fric_C", "c_fric")
DISAGREE = 3.0  # combined standard errors from which two modes are said to disagree


def write_identify_report(campaign: Campaign, result: Identification, path: str | Path) -> Path:
    """Write the report of a vehicle campaign as one HTML file and return its path."""
    hashes = "".join(f"{name} {digest[:12]}; " for name, digest in list(campaign.hashes.items())[:1])
    report = Report(
        f"Identified reference: {campaign.name}",
        "Steps I to III of Chugh et al. (2019) and a joint time-domain refinement",
        {"campaign": campaign.name, "runs": len(campaign.runs), "sha256": hashes.rstrip("; "), "slip": result.slip},
    )
    add_identification(report, result)
    return report.write(path)


def add_identification(report: Report, result: Identification) -> None:
    """Add all sections of an identification to a report."""
    first = next(iter(result.modes))
    speeds = result.modes[first]
    report.key_numbers(_key_numbers(speeds))
    _parameters(report, result, first)
    _vehicle(report, speeds)
    _steering(report, speeds)
    _steady_state(report, speeds)
    _refinement(report, speeds)
    if len(result.modes) == 2:
        _modes(report, result)
    _trust(report, result)


def _key_numbers(speeds: list[SpeedResult]) -> list[tuple[str, str]]:
    """Speeds, errors on runs that were held out, and the largest lag found."""
    numbers = [(str(len(speeds)), "speeds, " + ", ".join(f"{r.speed_kmh:g}" for r in speeds) + " km/h")]
    for label, text in (("refined", "torque error on held-out runs, refined"), ("steps", "the same, steps I to III")):
        found = [r.misfit[label] for r in speeds if label in r.misfit]
        if found:
            numbers.append((f"{100 * float(np.median(found)):.1f} %", text))
    lags = {n: v[0] for r in speeds for n, v in r.delays.items()}
    if lags:
        name = max(lags, key=lambda n: abs(lags[n]))
        numbers.append((f"{1e3 * lags[name]:.1f} ms", f"largest lag against the CAN bus ({name[6:]})"))
    return numbers


def _parameters(report: Report, result: Identification, mode: str) -> None:
    report.section("Parameters").text(
        "Value ± standard error. Errors hold for coloured residuals and carry those of early steps into later ones; "
        "a dash stands for what these data do not tell."
    )
    dynamic, static = STEERING[:3] + STEERING[7:], STEERING[3:7]
    tables = {"vehicle (step I)": VEHICLE, "dynamics (step II, refined)": dynamic, "assist (step III, refined)": static}
    for title, names in tables.items():
        rows = [[f"{r.speed_kmh:g}", *(_cell(r, n) for n in names)] for r in result.modes[mode]]
        report.table(["km/h", *(_label(n) for n in names)], rows, f"{mode}: {title}")


def _vehicle(report: Report, speeds: list[SpeedResult]) -> None:
    report.section("Vehicle frequency responses").text(
        "Dots are measured with the steering torque as instrument (Eq. 5); dots below a coherence of 0.85 are not "
        "fitted and not drawn. Lines are the single track with the parameters above and the lags found. A car rolls, a "
        "single track does not: differences around 1 to 3 Hz are that."
    )
    titles = {
        "yaw_rate": ("yaw rate per tyre angle", "1/s"),
        "lateral_acceleration": ("lateral acceleration per tyre angle", "m/(s² rad)"),
        "sideslip_angle": ("sideslip per tyre angle", "rad/rad"),
        "rack": ("rack force per rack travel", "N/m"),
    }
    for name, (title, unit) in titles.items():
        figure = figures.response(speeds, name, unit)
        if figure is not None:
            paper = "Figure 6" if name == "rack" else "Figure 5"
            report.figure(figure, f"{title.capitalize()} (as the paper's {paper}).")


def _steering(report: Report, speeds: list[SpeedResult]) -> None:
    report.section("Pinion frequency responses").text(
        "Lines are step II (Eq. 10 with linearised assist, no friction). Below 1 Hz the measured response holds the "
        "assist curve and friction, which this step cannot have; they are the refinement's business."
    )
    for name, title, unit in (
        ("pinion_angle", "Pinion angle per torsion-bar torque", "rad/(N m)"),
        ("pinion_rate", "Pinion rate per torsion-bar torque", "rad/(s N m)"),
    ):
        figure = figures.response(speeds, name, unit)
        if figure is not None:
            report.figure(figure, f"{title} (as the paper's Figure 7).")


def _steady_state(report: Report, speeds: list[SpeedResult]) -> None:
    report.section("Assist and hysteresis")
    curves = figures.assist_curves(speeds)
    if curves is None:
        report.text("> No steady-state run could be used, so there is no assist curve and no hysteresis.")
        return
    report.figure(curves, "Basic assist K_assist over torsion-bar torque (as the paper's Figure 8a), refined.")
    loops = figures.loops(speeds)
    if loops is not None:
        report.figure(
            loops,
            "Torsion-bar torque over pinion angle at 0.2 Hz (as the paper's Figures 8b and 8c): Eq. 16 at the "
            "measured motion, with the values of steps I to III and with the refined ones.",
        )


def _refinement(report: Report, speeds: list[SpeedResult]) -> None:
    used = [r for r in speeds if r.frf and "refine" not in r.skipped]
    if not used:
        return
    report.section("Refined against the paper's method").text(
        "Step II takes Coulomb friction for damping and the assist curve for inertia and gain. The refinement fits "
        "sweep and sine together in time, where each has its own signature."
    )
    for names, caption in (
        (("J_ref", "b_ref", "k_gain", "M_fric_C"), "Steering: the paper's steps, refined, and held-out torque error."),
        (("C_f", "C_r", "n_t", "J_z"), "Vehicle: the paper's steps I-a1 to I-b2, and each axle by its own equation."),
    ):
        rows = []
        for r in used:
            for label, values, errors in (("steps", r.frf, r.frf_std), ("refined", r.values, r.std)):
                cells = [with_error(values[n], errors.get(n)) if n in values else None for n in names]
                held = [_percent(r.misfit.get(label))] if "J_ref" in names else []
                rows.append([f"{r.speed_kmh:g}", label, *cells, *held])
        held_out = ["held-out error [%]"] if "J_ref" in names else []
        report.table(["km/h", "", *(_label(n) for n in names), *held_out], rows, caption)


def _modes(report: Report, result: Identification) -> None:
    own, shared = result.modes["per-speed"], result.modes["shared"]
    report.section("Per speed or shared").text(
        "A car's tyres, trail and inertia do not know its speed. Where the per-speed values leave the shared one by "
        "more than their errors, the single track misses an effect at that speed."
    )
    report.figure(figures.over_speed(own, shared, VEHICLE, _label), "Vehicle parameters over speed, 95 % intervals.")
    drawn = figures.over_speed(own, shared, STEERING[:6], _label)
    report.figure(drawn, "Steering parameters over speed, 95 % intervals.")
    rows = []
    for a, b in zip(own, shared, strict=True):
        apart = {n: d for n, d in disagreement(a, b).items() if abs(d) >= DISAGREE}
        if apart:
            text = ", ".join(f"{n} {d:+.1f}" for n, d in sorted(apart.items(), key=lambda item: -abs(item[1])))
            rows.append([f"{a.speed_kmh:g}", text])
    if rows:
        caption = f"Per-speed minus shared, in combined standard errors, where beyond {DISAGREE:g}."
        report.table(["km/h", "disagreement"], rows, caption)
    else:
        report.text("The two modes agree within their errors at every speed.")


def _trust(report: Report, result: Identification) -> None:
    report.section("What to trust")
    first = next(iter(result.modes))
    speeds = result.modes[first]
    names = list(dict.fromkeys(n for r in speeds for n in r.delays))
    if names:
        rows = [[f"{r.speed_kmh:g}", *(_milliseconds(r.delays.get(n)) for n in names)] for r in speeds]
        columns = ["km/h", *(f"{n[6:]} [ms]" for n in names)]
        report.table(columns, rows, "Lag of each sensor group behind the pinion angle; negative: its signal is newer.")
    rows = []
    for mode, results in result.modes.items():
        for r in results:
            lines = [f"step {step} skipped: {why}" for step, why in r.skipped.items()] + r.notes
            unknown = r.unidentified()
            if unknown:
                lines.append(f"not identified: {', '.join(unknown)}")
            rows += [[mode, f"{r.speed_kmh:g}", line] for line in dict.fromkeys(lines)]
    if rows:
        report.table(["mode", "km/h", "remark"], rows, "Skipped steps, values at a bound, and what was not identified.")
    for mode in result.modes:
        missing = result.missing_keys(mode)
        if missing:
            text = f"No reference was written for {mode}: no speed identifies {', '.join(missing)}."
            report.text("> " + escape(text))


def _cell(result: SpeedResult, name: str) -> str | None:
    value, error = result.values.get(name), result.std.get(name)
    if value is None or not math.isfinite(value) or name in result.unidentified():
        return None
    return with_error(value, error)


def _milliseconds(lag: tuple[float, float] | None) -> str | None:
    return None if lag is None else with_error(1e3 * lag[0], 1e3 * lag[1])


def _percent(share: float | None) -> str | None:
    return None if share is None else f"{100 * share:.1f}"


def _label(name: str) -> str:
    unit = quantities(ReferenceRow)[name].unit
    return name if unit == "-" else f"{name} [{unit}]"


assert set(VEHICLE) | set(STEERING) == set(KEYS)
