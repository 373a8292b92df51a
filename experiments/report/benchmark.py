"""The benchmark's report: which controller is best, how sure that is, why, and whether it is safe.

Every sentence that judges is made from the numbers; a block that a run does not have is left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from experiments.report.benchmark_cases import cases
from experiments.report.benchmark_causality import causality
from experiments.report.benchmark_figures import controllers_of
from experiments.report.benchmark_limits import limit, step_cost
from experiments.report.benchmark_method import method
from experiments.report.benchmark_plants import nominal_numbers, plant_section
from experiments.report.benchmark_ranking import answer, where_from
from experiments.report.benchmark_rig import beside_simulation
from experiments.report.benchmark_robustness import robustness
from experiments.report.benchmark_scope import policies, scope, subtitle
from experiments.report.page import Report
from experiments.report.style import looks_of

Result = dict[str, Any]


def make_report(summary: Mapping[str, Any], exhibits: Sequence[Result], scored: Sequence[Result]) -> Report:
    """The report of a benchmark.

    ``summary`` is the content of scores.json, ``exhibits`` and ``scored`` are results with their plots.
    ``summary`` may also have ``limit``, records {plant, causality, speed_kmh, arm, limit_jnd, reached:
    {controller: tracking_jnd}}, and ``step_cost``, {controller: {p50_us, p999_us}}.
    """
    results = [*exhibits, *scored]
    ranking = summary.get("ranking") or ()
    proven = [a["controller"] for a in summary.get("assessments") or ()]
    looks = looks_of([*controllers_of(results), *(s["controller"] for s in ranking), *dict.fromkeys(proven)])
    looks = {name: looks[name] for name in dict.fromkeys([*(s["controller"] for s in ranking), *looks])}  # best first
    report = Report(
        "Controllers that have to feel like their reference",
        subtitle(summary),
        {
            **{name: summary[name] for name in ("protocol", "reference", "seed") if name in summary},
            "controllers": len(looks),
            "scored episodes": f"{len(scored):,}",
        },
    )
    report.section("The answer")
    scope(report, summary)
    if ranking:
        answer(report, summary, looks)
    else:
        missing = "No test case was driven, so there is no ranking: only exhibits on the nominal plant."
        report.text("There is no ranking." if scored else missing)
        nominal_numbers(report, summary, looks)
    policies(report, summary, looks)
    beside_simulation(report, summary, looks)
    where_from(report, scored, looks)
    robustness(report, summary, looks)
    for plant in dict.fromkeys(r["case"]["plant"] for r in results):
        plant_section(report, plant, summary, exhibits, scored, looks)
    causality(report, scored, looks)
    limit(report, summary, looks)
    step_cost(report, summary, looks)
    cases(report, scored, looks)
    method(report, summary)
    return report
