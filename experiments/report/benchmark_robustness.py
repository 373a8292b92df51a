"""What the loops survive: the linear proof's map, margins, failing places, and what simulation says to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.margins import disk_gain, disk_phase_deg
from experiments.report.benchmark_robustness_map import GOOD_DISK, robustness_map
from experiments.report.benchmark_safety import place_words, unstable_at
from experiments.report.page import Report
from experiments.report.style import Look
from experiments.z_width import DAMPING, STIFFNESS

Record = Mapping[str, Any]
Looks = Mapping[str, Look]
MOST_PLACES = 8  # of one controller in the table of failing places


def robustness(report: Report, summary: Record, looks: Looks) -> None:
    """The section on the proof; nothing where none was made."""
    gates: Sequence[Record] = summary.get("gates") or ()
    assessments: Sequence[Record] = summary.get("assessments") or ()
    confirmations: Sequence[Record] = summary.get("confirmations") or ()
    if not (gates or assessments or confirmations):
        return
    report.section("Is it stable?")
    if assessments:
        report.text(_judged(assessments))
        low, high = disk_gain(GOOD_DISK)
        report.figure(
            robustness_map(assessments, looks),
            "Worst disk margin over operating points and arms, the nominal plant. Dark red: unstable at least at one "
            "place, with the fastest growth in 1/s. *: unstable also where the reference itself is, which is not held "
            f"against the controller; grey: there the reference is unstable. A disk margin of {GOOD_DISK:g} bears a "
            f"factor of {low:.2f} to {high:.2f} on the gain, or {disk_phase_deg(GOOD_DISK):.0f} deg of phase. "
            "Hover for the worst place and its margins.",
        )
    if gates:
        report.table(*_margins(gates, summary.get("limits") or {}, looks), dense=True)
    if assessments:
        _failing(report, assessments, looks)
        _own_failures(report, assessments)
    if confirmations:
        _confirmed(report, confirmations, looks)
    _z_widths(report, summary.get("z_width") or (), looks)


def _z_widths(report: Report, widths: Sequence[Record], looks: Looks) -> None:
    if not widths:
        return
    systems = list(dict.fromkeys(f"{w['plant']} {w['causality']}" for w in widths))
    at = {(f"{w['plant']} {w['causality']}", w["controller"]): w for w in widths}

    def cell(width: Record | None) -> str | None:
        if width is None or width["width"] is None:
            return None
        return f"{100.0 * width['width']:.0f} % ({width['stiffness']:g} x, {width['damping']:g} x)"

    report.table(
        ["controller", *systems],
        [[look.label, *(cell(at.get((system, name))) for system in systems)] for name, look in looks.items()],
        "Z-width: share of the virtual springs and dampers, multiples of the reference's own at about 75 km/h, that "
        "the loop renders stably with every arm, of those that the reference itself bears. In brackets the largest "
        f"stiffness and damping with the other left as it is (tried up to {STIFFNESS[-1]:g} and {DAMPING[-1]:g}).",
    )


def _judged(assessments: Sequence[Record]) -> str:
    names = list(dict.fromkeys(a["controller"] for a in assessments))
    failing = {name: unstable_at(assessments, name) for name in names}
    bad = [name for name in names if failing[name]]
    judged = sum(a["reference_stable"] for a in assessments)
    text = (
        f"The loop of every controller, linearised at {judged} places (system, speed, operating point, arm) where the "
        "perfectly tracked reference is stable: "
    )
    if not bad:
        return f"{text}all are stable."
    count = sum(map(len, failing.values()))
    speeds = sorted({a["speed_kmh"] for found in failing.values() for a in found})
    where = f"{speeds[0]:g} km/h" if len(speeds) == 1 else f"{speeds[0]:g} to {speeds[-1]:g} km/h"
    return f"{text}{count} are unstable, by {len(bad)} of {len(names)} controllers, at {where}."


def _margins(gates: Sequence[Record], limits: Record, looks: Looks) -> tuple[list[str], list[list[object]], str]:
    columns = ["system", "controller", "growth [1/s]", "gain [dB]", "phase [deg]", "disk", "delay [ms]",
               "arm x", "gap: wheel", "gap: bar", "unstable", "reference's"]  # fmt: skip
    rows: list[list[object]] = [
        [
            f"{gate['plant']} {gate['causality']}", looks[gate["controller"]].label, f"{gate['growth']:.1f}",
            _up_to(gate["gain_margin_dB"], limits.get("gain_margin_dB"), 1), f"{gate['phase_margin_deg']:.1f}",
            f"{gate['disk_margin']:.2f}", _up_to(gate["delay_margin_ms"], limits.get("delay_margin_ms"), 1),
            _up_to(gate["arm_radius"], limits.get("arm_radius"), 2), f"{gate['passivity_gap']:.1f}",
            f"{gate['bar_passivity_gap']:.1f}", len(gate["failures"]), len(gate["reference_failures"]),
        ]
        for gate in sorted(gates, key=lambda gate: (gate["plant"], gate["causality"] != "impedance"))
    ]  # fmt: skip
    caption = (
        "Worst over the places where the reference is stable; margins are those of the loop opened at the motor's "
        "command, 0 where it is unstable, ≥ where the search ended. Arm x: the smallest factor on the arm's "
        "inertia, damping and stiffness that destabilises. Passivity gap in N m s/rad: least Re Z minus the "
        "reference's over 0.2–30 Hz, at the wheel and at the torsion bar; below 0 the loop can feed back more energy "
        "than the reference. Unstable: places; reference's: those where the reference is unstable too."
    )
    return columns, rows, caption


def _up_to(value: float, limit: float | None, digits: int) -> str:
    return f"≥ {limit:g}" if limit is not None and value >= limit else f"{value:.{digits}f}"


def _failing(report: Report, assessments: Sequence[Record], looks: Looks) -> None:
    rows: list[list[object]] = []
    hidden = 0
    for name in dict.fromkeys(a["controller"] for a in assessments):
        found = unstable_at(assessments, name)
        hidden += max(len(found) - MOST_PLACES, 0)
        rows += [
            [looks[name].label, place_words(a), f"{a['growth']:.1f}", f"{a['frequency_Hz']:.1f}",
             f"{a['reference_growth']:.2f}"]
            for a in found[:MOST_PLACES]
        ]  # fmt: skip
    if rows:
        more = f" {hidden} more of them are in scores.json." if hidden else ""
        report.table(
            ["controller", "where", "growth [1/s]", "at [Hz]", "reference's growth [1/s]"],
            rows,
            "Places where a controller makes an unstable loop of a stable reference; at most the "
            f"{MOST_PLACES} fastest of each controller.{more}",
            dense=True,
        )


def _own_failures(report: Report, assessments: Sequence[Record]) -> None:
    own: dict[str, float] = {}
    for a in assessments:
        if not a["reference_stable"]:
            own[place_words(a)] = a["reference_growth"]
    if own:
        worst = max(own, key=lambda place: own[place])
        report.text(
            f"The reference itself, perfectly tracked, is unstable at {len(own)} places, fastest at {worst} "
            f"({own[worst]:.2f} 1/s). Nothing can be asked of a controller there."
        )


def _confirmed(report: Report, confirmations: Sequence[Record], looks: Looks) -> None:
    told = [c for c in confirmations if c["agrees"] is not None]
    agreeing = sum(c["agrees"] for c in told)
    thrown = sum(c["thrown"] for c in confirmations)
    text = (
        f"The fastest growing place of each controller and system with friction stuck was simulated in the non-linear "
        f"program: in {agreeing} of {len(told)} the small motion grows or decays as the linear model says."
    )
    if len(told) < len(confirmations):
        text += f" In {len(confirmations) - len(told)} it was lost too soon to be measured."
    if thrown:
        text += f" After a kick that a hand would feel, {thrown} of {len(confirmations)} left all limits."
    report.text(text)
    report.table(
        ["controller", "where", "linear [1/s]", "simulated [1/s]", "agrees", "left after a kick [N m]"],
        [
            [looks[c["controller"]].label, place_words(c), f"{c['growth']:.2f}",
             None if c["simulated_growth"] is None else f"{c['simulated_growth']:.2f}",
             {True: "yes", False: "no", None: None}[c["agrees"]],
             "thrown out" if c["thrown"] else f"{c['left_Nm']:.3f}"]
            for c in confirmations
        ],
        "Growth of a small difference, linear and simulated, and the torsion-bar torque's range that is left after a "
        "kick of 0.3 rad/s: friction and limits may catch an unstable loop in a limit cycle.",
        dense=True,
    )  # fmt: skip
