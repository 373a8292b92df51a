"""What the benchmark does, for whoever wants to judge its answer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from experiments.bench_protocol import Protocol
from experiments.measures import JND, JND_DB, JND_DEG
from experiments.metrics import METRICS, Metric
from experiments.report.page import Report

GROUPS = {
    "tracking": "Tracked signal", "felt": "Felt torque", "frf": "Frequency response", "worst": "Frequency response",
    "transparency": "Frequency response", "passivity": "Passivity", "ripple": "Ripple and jerk",
    "hand": "Ripple and jerk", "jerk": "Ripple and jerk", "effort": "Effort", "motor": "Effort",
    "saturation": "Effort", "slew": "Effort",
}  # fmt: skip
REST = "Slow steering, letting go"
BETTER = {"lower": "lower", "higher": "higher", "reference": "as the reference"}


def method(report: Report, summary: Mapping[str, Any]) -> None:
    """Text and the table of metrics."""
    protocol = Protocol.load()
    report.section("How this was found")
    report.text(
        "**Compared signals.** True signals are scored, not what the control unit believes. Impedance: the torsion-bar "
        "torque against the torque of the reference at the true pinion motion. Admittance: the pinion angle against "
        "the angle of the reference under the true torsion-bar torque. Responses are estimated with the wheel torque "
        "as instrument over three neighbouring lines, and only points with a coherence of 0.85 or more count. The "
        "complete reference and its linear form differ on centre by a factor of 1 + k_gain and are never mixed."
    )
    report.text(
        f"**Cases.** {len(protocol.manoeuvres)} manoeuvres ({_listed(protocol.manoeuvres)}) at "
        f"{', '.join(f'{v:g}' for v in protocol.speeds_kmh)} km/h with {len(protocol.arms)} arms "
        f"({_listed(protocol.arms)}), {protocol.draws} draws each of plant, car and the manoeuvre's size; a quick run "
        "takes a part of them. The "
        "controller knows the nominal plant only; noise and draws are the same for every controller. Training cases, "
        "for tuning and learning, take their draws from other seeds than test cases, and only test cases are scored. "
        "Beside them stand exhibits on the nominal plant, as in the paper's Figures 9 to 11."
    )
    report.text(
        f"**Score.** One just noticeable difference (JND) is {100.0 * JND:.0f} % of the reference: {JND_DB:.1f} dB or "
        f"{JND_DEG:.1f} deg in a response, which follows from what drivers can tell apart in force and angle. A case's "
        f"score is the mean of the metrics below, each at most {protocol.worst_score_jnd:g} JND, which is also what an "
        "unstable episode gets. A controller's score is the interquartile mean over its cases: the best and the worst "
        f"quarter are left out, so that no single case decides. Intervals "
        f"({100.0 * protocol.bootstrap['coverage']:.0f} %) come from {protocol.bootstrap['resamples']:.0f} resamplings "
        "of the draws within each place, the same for all controllers (of the places themselves where there is one "
        "draw only)."
    )
    report.table(
        ["manoeuvre", "metrics whose mean is the score"],
        [[name.replace("_", " "), ", ".join(metrics)] for name, metrics in protocol.score.items()],
        f"What is scored in {summary.get('protocol', protocol.name)}.",
    )
    report.text(
        "**Gates.** Safety is no part of the score, because an interquartile mean would hide exactly the dangerous "
        "cases: a controller stands behind all safe ones if its loop is unstable at one place of the linear proof or "
        "in one test episode. The proof linearises the loop at every speed, on centre and where the assist is "
        "steepest, friction stuck and sliding, with every arm. A law that acts anew only every few periods is judged "
        "by the modes of such a step, exactly, as are its margins; its impedances are those at the driving frequency. "
        "Where the reference itself, perfectly tracked, is unstable with an arm, neither counts: that is the "
        "reference's property."
    )
    report.table(
        ["group", "metric", "unit", "better", "meaning"],
        [[group, name, m.unit, BETTER[m.better], m.meaning] for group, name, m in _grouped(METRICS)],
        "Metrics of every case, in scores.csv and scores.json; one that a case cannot tell is left empty. Where as the "
        "reference is better, NAME_reference is the reference's own value.",
        dense=True,
    )


def _group(name: str) -> str:
    return GROUPS.get(name.split("_")[0], REST)


def _grouped(metrics: Mapping[str, Metric]) -> list[tuple[str, str, Metric]]:
    """(Group, name, metric) without the references' rows; the group stands at its first metric only."""
    own = [(name, metric) for name, metric in metrics.items() if metric.better]
    groups = {group: [pair for pair in own if _group(pair[0]) == group] for group in (*GROUPS.values(), REST)}
    return [(group if k == 0 else "", *pair) for group, pairs in groups.items() for k, pair in enumerate(pairs)]


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)
