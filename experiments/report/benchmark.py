"""The benchmark's report; every sentence that judges is made from the numbers."""

from collections.abc import Sequence
from typing import Any

from experiments.bench_verdict import BASELINE, LIMIT_DB, LIMIT_DEG, Verdict
from experiments.metrics import METRICS
from experiments.report import benchmark_figures as figures
from experiments.report.page import Report

Result = dict[str, Any]
SHOWN_SPEED_KMH = 75.0  # the paper's Figures 9 to 11
# Columns of the two score tables: heading with its line for the unit, metric.
CHIRP_COLUMNS = {
    "error": "tracking_error",
    "of reference": "tracking_relative",
    "FRF [dB]": "frf_magnitude",
    "FRF [deg]": "frf_phase",
    "ripple [N m]": "ripple",
}
SINE_COLUMNS = {
    "error": "tracking_error",
    "of reference": "tracking_relative",
    "hysteresis [N m]": "torque_hysteresis",
    "hysteresis [deg]": "angle_hysteresis",
    "stiffness [N m/deg]": "on_centre_stiffness",
}


def make_report(results: Sequence[Result], found: Sequence[Verdict], reference: str, seed: int) -> Report:
    """The report of a benchmark: answer, score tables, and plots as the paper's Figures 9 to 11."""
    report = Report(
        "Controllers that have to feel like their reference",
        "EPAS and steer-by-wire, torque tracking (impedance) and angle tracking (admittance)",
        {"reference": reference, "seed": seed, "episodes": len(results)},
    )
    _answer(report, results, found)
    for plant in dict.fromkeys(r["case"]["plant"] for r in results):
        here = [r for r in results if r["case"]["plant"] == plant]
        _plant(report, plant, here, [v for v in found if v.plant == plant])
    _tables(report, results)
    _method(report)
    return report


def _answer(report: Report, results: Sequence[Result], found: Sequence[Verdict]) -> None:
    report.section("The answer")
    tracked = [v for v in found if v.controller != BASELINE and v.factor is not None]
    if tracked:
        worst = min(tracked, key=lambda v: v.factor or 0.0)
        numbers = [(f"{worst.factor:.1f} x", "smallest advantage over the open-loop map")]
        judged = [v for v in tracked if v.within is not None]
        if judged:
            dB = max(v.worst_magnitude_dB or 0.0 for v in judged)
            deg = max(v.worst_phase_deg or 0.0 for v in judged)
            numbers += [
                (f"{dB:.2f} dB", "largest deviation from the linear reference, 0.2-4 Hz"),
                (f"{deg:.1f} deg", "largest phase deviation, 0.2-4 Hz"),
            ]
        numbers.append((str(sum(v.unstable for v in found)), "episodes that turned unstable"))
        report.key_numbers(numbers)
    report.table(
        ["plant", "causality", "controller", "error [%]", "map's error is", "dB", "deg", "verdict"],
        [
            [
                v.plant,
                v.causality,
                v.controller,
                None if v.error is None else f"{100.0 * v.error:.1f}",
                None if v.factor is None else f"{v.factor:.1f} x",
                None if v.worst_magnitude_dB is None else f"{v.worst_magnitude_dB:.2f}",
                None if v.worst_phase_deg is None else f"{v.worst_phase_deg:.1f}",
                v.short,
            ]
            for v in found
        ],
        "Error: geometric mean over speeds, manoeuvres and arms of the rms error over the rms of "
        "the reference. dB and deg: largest deviation from the linear reference at 75 km/h, "
        f"0.2-4 Hz (asked for: {LIMIT_DB} dB and {LIMIT_DEG:.0f} deg).",
    )
    report.figure(figures.errors(results), "Tracking error of every episode; hover for the case.")


def _plant(report: Report, plant: str, here: Sequence[Result], found: Sequence[Verdict]) -> None:
    report.section(plant)
    for v in found:
        report.text(f"**{v.controller}, {v.causality}.** {v.text}")
    linear = [r for r in here if r["case"]["linear"] and not r["case"]["prompt"]]
    arms = list(dict.fromkeys(r["case"]["arm"] for r in here))
    if linear:
        report.figure(
            figures.responses([r for r in linear if r["case"]["arm"] == arms[0]]),
            f"{plant} with the linear reference at {SHOWN_SPEED_KMH:.0f} km/h, {arms[0]} arm (as "
            "the paper's Figure 9): no friction, K_assist = 1 + k_gain. Dots: achieved.",
        )
        report.figure(
            figures.deviations(linear, LIMIT_DB, LIMIT_DEG),
            f"{plant}: deviation from the linear reference. Grey: what is asked for.",
        )
    complete = [
        r
        for r in here
        if not r["case"]["linear"] and r["case"]["speed_kmh"] == SHOWN_SPEED_KMH and r["case"]["arm"] == arms[0]
    ]
    chirps = [r for r in complete if r["case"]["manoeuvre"] == "frequency_response"]
    sines = [r for r in complete if r["case"]["manoeuvre"] == "steady_state"]
    if chirps:
        report.figure(
            figures.responses(chirps),
            f"{plant} with the complete reference at {SHOWN_SPEED_KMH:.0f} km/h (as the paper's "
            "Figure 10): basic assist and friction included. Dots: achieved. Lines: the ideal "
            "response in the same run, because a non-linear reference depends on the amplitude.",
        )
    if sines:
        report.figure(
            figures.loops(sines),
            f"{plant}: steady-state response at {SHOWN_SPEED_KMH:.0f} km/h, 0.2 Hz (as the paper's "
            "Figure 11). Dashed: the reference in the same run.",
        )


def _tables(report: Report, results: Sequence[Result]) -> None:
    report.section("All scores")
    complete = [r for r in results if not r["case"]["linear"]]
    head = ["system", "controller", "km/h", "arm"]
    for manoeuvre, columns, caption in (
        (
            "frequency_response",
            CHIRP_COLUMNS,
            "Chirp of 0.2-5 Hz, complete reference; error in N m (impedance) or deg.",
        ),
        (
            "steady_state",
            SINE_COLUMNS,
            "Sine of 0.2 Hz, complete reference; error in N m or deg. Hysteresis widths and on-centre stiffness: "
            "achieved (of the reference).",
        ),
    ):
        rows = []
        for r in complete:
            case = r["case"]
            if case["manoeuvre"] == manoeuvre:
                place = [f"{case['plant']} {case['causality']}", case["controller"]]
                place += [f"{case['speed_kmh']:.0f}", case["arm"]]
                rows.append([*place, *(_cell(r, name) for name in columns.values())])
        more = " scores.csv has every metric of every episode."
        report.table([*head, *columns], rows, caption + more)


def _cell(result: Result, name: str) -> object:
    if not result["stable"]:
        return "unstable"
    value = result["scores"].get(name)
    wanted = result["scores"].get(f"{name}_reference")
    if value is None:
        return None
    if wanted is None:
        return f"{100.0 * value:.1f} %" if name == "tracking_relative" else f"{value:.3g}"
    return f"{value:.3g} ({wanted:.3g})"


def _method(report: Report) -> None:
    report.section("What is compared with what")
    report.text(
        "True signals are scored, not what the control unit believes. Impedance: the torsion-bar "
        "torque against the torque of the reference at the true pinion motion. Admittance: the "
        "pinion angle against the angle of the reference under the true torsion-bar torque. "
        "Responses are estimated with the wheel torque as instrument over three neighbouring "
        "lines, and only points with a coherence of 0.85 or more count. The complete reference "
        "and its linear form differ on-centre by a factor of 1 + k_gain and are never mixed here."
    )
    report.table(
        ["metric", "unit", "meaning"],
        [[name, m.unit, m.meaning] for name, m in METRICS.items()],
        "Metrics in scores.csv.",
    )
