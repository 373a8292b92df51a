"""One plant's section: its rankings, what was measured on the nominal plant, responses, loops and score maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from experiments.bench_cases import FAST_CHIRP, RAMP
from experiments.bench_verdict import BASELINE, LIMIT_DB, LIMIT_DEG, REQUIRED_BAND_HZ, Verdict
from experiments.measures import JND_DB, JND_DEG
from experiments.metrics import BAND_HZ
from experiments.metrics_trial import FAST_BAND_HZ
from experiments.report import benchmark_figures as figures
from experiments.report.benchmark_safety import safeties
from experiments.report.benchmark_scores import by_speed_and_arm, columns_of, score_maps
from experiments.report.page import Report
from experiments.report.style import Look

Record = Mapping[str, Any]
Result = dict[str, Any]
Looks = Mapping[str, Look]
SHOWN_SPEED_KMH, SHOWN_ARM = 75.0, "relaxed"  # the paper's Figures 9 to 11
CHIRP, SINE = "frequency_response", "steady_state"
TITLES = {"EPAS": "Electric power steering (EPAS)", "SbW": "Steer-by-wire (SbW)"}


def plant_section(
    report: Report, plant: str, summary: Record, exhibits: Sequence[Result], scored: Sequence[Result], looks: Looks
) -> None:
    """Everything about one plant, impedance beside admittance."""
    report.section(TITLES.get(plant, plant))
    systems = [s for s in summary.get("systems") or () if s["plant"] == plant]
    if systems:
        report.table(*_rankings(systems, summary, looks), dense=True)
    shown_exhibits = [r for r in exhibits if r["case"]["plant"] == plant]
    shown_scored = [r for r in scored if r["case"]["plant"] == plant]
    if not systems:  # then this is all there is to say
        _nominal(report, plant, summary, looks)
    _deviations(report, plant, shown_exhibits, shown_scored, looks)
    _signals(report, plant, shown_exhibits, looks)
    _dead_bands(report, plant, shown_exhibits, looks)
    _maps(report, plant, shown_scored, looks)
    if systems:
        _nominal(report, plant, summary, looks)


def nominal_numbers(report: Report, summary: Record, looks: Looks) -> None:
    """Key numbers of the exhibits, for a run without test cases."""
    found = [Verdict(**v) for v in summary.get("verdicts") or ()]
    tracked = [v for v in found if v.controller != BASELINE and v.factor is not None]
    numbers = []
    if tracked:
        worst = min(tracked, key=lambda v: v.factor or 0.0)
        label = looks[worst.controller].label
        where = f"{worst.plant} {worst.causality}"
        numbers.append((f"{worst.factor:.1f} x", f"smallest advantage over the open-loop map: {label}, {where}"))
    judged = [v for v in tracked if v.within is not None]
    if judged:
        dB = max(v.worst_magnitude_dB or 0.0 for v in judged)
        deg = max(v.worst_phase_deg or 0.0 for v in judged)
        numbers += [
            (f"{dB:.2f} dB", "largest deviation from the linear reference, 0.2-4 Hz"),
            (f"{deg:.1f} deg", "largest phase deviation, 0.2-4 Hz"),
        ]
    if found:
        numbers.append((str(sum(v.unstable for v in found)), "episodes that turned unstable"))
        report.key_numbers(numbers)


def _rankings(
    systems: Sequence[Record], summary: Record, looks: Looks
) -> tuple[list[str], list[list[object]], str]:
    columns = ["causality", "rank (95\u00a0%)", "controller", "score\u00a0[JND] (95\u00a0%)", "best", "unstable",
               "safety"]  # fmt: skip
    rows: list[list[object]] = []
    for system in systems:
        where = system["plant"], system["causality"]
        found = safeties(system["ranking"], summary, where)
        for s in system["ranking"]:
            safety, (low, high) = found[s["controller"]], s["score_interval"]
            rows.append(
                [
                    system["causality"], f"{s['rank']} ({s['rank_interval'][0]}–{s['rank_interval'][1]})",
                    looks[s["controller"]].label, f"{s['score']:.2f} ({low:.2f}–{high:.2f})",
                    f"{100.0 * s['chance_of_best']:.0f} %", f"{s['unstable']} of {s['cases']}",
                    Markup("{}: {}").format(safety.verdict, safety.counts),
                ]
            )  # fmt: skip
    return columns, rows, f"{systems[0]['plant']}: ranking in each causality, gates of that system only."


def _deviations(
    report: Report, plant: str, exhibits: Sequence[Result], scored: Sequence[Result], looks: Looks
) -> None:
    chirps = [r for r in scored if r["case"]["manoeuvre"] == CHIRP and _shown(r) and r["case"]["draw"] == 0]
    curves = [curve for curve in map(figures.deviation_of, chirps) if curve is not None]
    if curves:
        report.figure(
            figures.deviations(curves, JND_DB, JND_DEG, BAND_HZ, looks),
            f"{plant}: frequency response over the complete reference's, scored chirps at {SHOWN_SPEED_KMH:.0f} km/h, "
            f"{SHOWN_ARM} arm, first draw. Band: one JND, {JND_DB:.1f} dB and {JND_DEG:.1f} deg; what lies inside, a "
            f"driver does not notice.{_lost(chirps, looks)} A click on a name hides it, a double click shows it alone.",
        )
    linear = [r for r in exhibits if r["case"]["linear"] and not r["case"]["prompt"]]
    curves = [curve for curve in map(figures.deviation_of, linear) if curve is not None]
    if curves:
        report.figure(
            figures.deviations(curves, LIMIT_DB, LIMIT_DEG, REQUIRED_BAND_HZ, looks),
            f"{plant}, nominal plant: deviation from the linear reference at {SHOWN_SPEED_KMH:.0f} km/h. Band: "
            f"what is asked for, {LIMIT_DB} dB and {LIMIT_DEG:.0f} deg over "
            f"{REQUIRED_BAND_HZ[0]:g}-{REQUIRED_BAND_HZ[1]:g} Hz.",
        )
    fast = [r for r in exhibits if r["case"]["manoeuvre"] == FAST_CHIRP]
    curves = [curve for curve in map(figures.deviation_of, fast) if curve is not None]
    if curves:
        report.figure(
            figures.deviations(curves, JND_DB, JND_DEG, FAST_BAND_HZ, looks),
            f"{plant}, nominal plant: the same against the complete reference at {FAST_BAND_HZ[0]:g}-"
            f"{FAST_BAND_HZ[1]:g} Hz, which only a robot can drive: what bumps and vibration meet. Band: one JND."
            f"{_lost(fast, looks)}",
        )


def _signals(report: Report, plant: str, exhibits: Sequence[Result], looks: Looks) -> None:
    here = [r for r in exhibits if _shown(r) and not r["case"]["prompt"]]
    linear = [r for r in here if r["case"]["linear"]]
    complete = [r for r in here if not r["case"]["linear"] and r["case"]["manoeuvre"] == CHIRP]
    sines = [r for r in here if r["case"]["manoeuvre"] == SINE]
    place = f"{SHOWN_SPEED_KMH:.0f} km/h, {SHOWN_ARM} arm"
    if any(r["plot"] for r in linear):
        report.figure(
            figures.responses(linear, looks),
            f"{plant}, nominal plant with the linear reference at {place} (as the paper's Figure 9): no friction, "
            f"K_assist = 1 + k_gain. Dots: achieved.{_lost(linear, looks)}",
        )
    if any(r["plot"] for r in complete):
        report.figure(
            figures.responses(complete, looks),
            f"{plant}, nominal plant with the complete reference at {place} (as the paper's Figure 10): basic assist "
            "and friction included. Dots: achieved. Lines: the ideal response in the same run, because a non-linear "
            f"reference depends on the amplitude.{_lost(complete, looks)}",
        )
    if any(r["plot"] for r in sines):
        report.figure(
            figures.loops(sines, looks),
            f"{plant}, nominal plant: steady-state response at {place}, 0.2 Hz (as the paper's Figure 11).",
        )


def _dead_bands(report: Report, plant: str, exhibits: Sequence[Result], looks: Looks) -> None:
    ramps = [r for r in exhibits if r["case"]["manoeuvre"] == RAMP and r["stable"]]
    if not ramps:
        return

    def cell(result: Result, name: str) -> str | None:
        values = result["scores"].get(name), result["scores"].get(f"{name}_reference")
        return None if None in values else f"{values[0]:.2f} ({values[1]:.2f})"

    report.table(
        ["causality", "controller", "torque dead band [N m]", "wheel-angle dead band [deg]"],
        [
            [r["case"]["causality"], looks[r["case"]["controller"]].label,
             *(cell(r, name) for name in ("torque_dead_band", "angle_dead_band"))]
            for r in ramps
        ],
        f"{plant}, nominal plant, not scored: how far torque and wheel go from the centre before the car answers, in a "
        f"slow ramp at {SHOWN_SPEED_KMH:.0f} km/h, {SHOWN_ARM} arm; the reference's in brackets.",
        dense=True,
    )  # fmt: skip


def _maps(report: Report, plant: str, scored: Sequence[Result], looks: Looks) -> None:
    if not scored:
        return
    panels = {
        (manoeuvre.replace("_", " "), causality): by_speed_and_arm(cases)
        for manoeuvre, here in columns_of(scored, lambda case: case["manoeuvre"])
        for causality, cases in columns_of(here, lambda case: case["causality"])
    }
    names = [name for name in looks if any(r["case"]["controller"] == name for r in scored)]
    report.figure(
        score_maps(panels, names, looks),
        f"{plant}: score in JND (interquartile mean) by manoeuvre, speed and arm. ×: unstable episodes among these.",
    )


def _nominal(report: Report, plant: str, summary: Record, looks: Looks) -> None:
    found = [Verdict(**v) for v in summary.get("verdicts") or () if v["plant"] == plant]
    if not found:
        return
    report.table(
        ["causality", "controller", "error [%]", "map's error is", "dB", "deg", "verdict"],
        [
            [
                v.causality, looks[v.controller].label, None if v.error is None else f"{100.0 * v.error:.1f}",
                None if v.factor is None else f"{v.factor:.1f} x",
                None if v.worst_magnitude_dB is None else f"{v.worst_magnitude_dB:.2f}",
                None if v.worst_phase_deg is None else f"{v.worst_phase_deg:.1f}", v.short,
            ]
            for v in found
        ],
        f"{plant}, nominal plant, not scored. Error: geometric mean over the exhibits of the rms error over the rms of "
        "the reference. dB and deg: largest deviation from the linear reference at "
        f"{SHOWN_SPEED_KMH:.0f} km/h, 0.2-4 Hz (asked for: {LIMIT_DB} dB and {LIMIT_DEG:.0f} deg).",
        dense=True,
    )  # fmt: skip
    words = "".join(
        f"<p><b>{escape(looks[v.controller].label)}, {escape(v.causality)}.</b> {escape(v.text)}</p>" for v in found
    )
    report.text(f"<details><summary>{escape(plant)}: these numbers in words</summary>{words}</details>")


def _shown(result: Result) -> bool:
    return (result["case"]["speed_kmh"], result["case"]["arm"]) == (SHOWN_SPEED_KMH, SHOWN_ARM)


def _lost(results: Sequence[Result], looks: Looks) -> str:
    """A sentence on the cases that could not be drawn."""
    lost = [f"{looks[c['controller']].label} ({c['causality']})" for r in results for c in [r["case"]] if not r["plot"]]
    return f" Not drawn, because they turned unstable: {', '.join(lost)}." if lost else ""
