"""What a benchmark comes to: scores.json, scores.csv, the report, and the tables on stdout."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.bench_cases import Case
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import Standing, case_score, standings
from experiments.bench_run import Result
from experiments.bench_verdict import Verdict, verdicts
from experiments.metrics import METRICS
from steer_env import __version__, atomic

SCHEMA_VERSION = 2


def write_scores(
    out: Path | None,
    results: Sequence[Result],
    source: str,
    seed: int,
    gates: dict[str, list[str]],
    proof: dict[str, Any],
    quick: bool = False,
) -> dict[str, Any]:
    """The content of scores.json; with ``out`` also the three files, each whole or not at all."""
    protocol = Protocol.load()
    scored = [result for result in results if result["case"]["split"] == "test"]
    exhibits = [result for result in results if not result["case"]["split"]]
    systems = dict.fromkeys((r["case"]["plant"], r["case"]["causality"]) for r in scored)
    found = verdicts(exhibits)
    summary = {
        "schema_version": SCHEMA_VERSION,
        "software_version": __version__,
        "protocol": protocol.name + (" (quick)" if quick else "") + (" through the CAN path" if "rig" in proof else ""),
        "reference": source,
        "seed": seed,
        "ranking": [s._asdict() for s in standings(scored, protocol, gates, seed)],
        "systems": [
            {"plant": plant, "causality": causality, "ranking": [s._asdict() for s in here]}
            for plant, causality in systems
            for here in [standings(_of(scored, plant, causality), protocol, gates_at(gates, plant, causality), seed)]
        ],
        "verdicts": [verdict._asdict() for verdict in found],
        **proof,
        "metrics": {name: {"unit": m.unit, "meaning": m.meaning} for name, m in METRICS.items()},
        "results": [
            {**{k: v for k, v in r.items() if k != "plot"}, "score": case_score(r, protocol)}
            if r["case"]["split"]
            else {k: v for k, v in r.items() if k != "plot"}
            for r in results
        ],
    }
    if out is not None:
        from experiments.report.benchmark import make_report  # plotly loads when something is drawn

        text = json.dumps(summary, allow_nan=False, separators=(",", ":"))
        atomic.write_text(out / "scores.json", text.replace('{"case"', '\n{"case"') + "\n")
        atomic.write_text(out / "scores.csv", csv_of(results))
        make_report(summary, exhibits, scored).write(out / "report.html")
    return summary


def gates_at(gates: dict[str, list[str]], plant: str, causality: str) -> dict[str, list[str]]:
    """The reasons that concern one system; each begins with the system's name."""
    where = f"{plant} {causality}"
    return {name: [reason for reason in reasons if reason.startswith(where)] for name, reasons in gates.items()}


def _of(results: Sequence[Result], plant: str, causality: str) -> list[Result]:
    return [r for r in results if (r["case"]["plant"], r["case"]["causality"]) == (plant, causality)]


def csv_of(results: Sequence[Result]) -> str:
    """One line per case: what it is, its score, whether it was stable, every metric (empty: not defined)."""
    protocol = Protocol.load()
    fields = list(Case.__dataclass_fields__)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*fields, "stable", "score_jnd", *METRICS])
    for result in results:
        scores = [result["scores"].get(name) for name in METRICS]
        row = [result["case"][field] for field in fields]
        score = repr(case_score(result, protocol)) if result["case"]["split"] else ""
        writer.writerow([*row, result["stable"], score, *("" if v is None else f"{v:.7g}" for v in scores)])
    return text.getvalue()


def ranking_table(found: Sequence[Standing], proven: set[str]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows of the ranking on stdout; ``proven`` are those with a linear proof."""
    columns = ["rank", "95 %", "controller", "JND", "95 % of JND", "best", "unstable", "gate"]
    rows: list[list[object]] = [
        [s.rank, f"{s.rank_interval[0]}-{s.rank_interval[1]}", s.controller, f"{s.score:.2f}",
         f"{s.score_interval[0]:.2f}-{s.score_interval[1]:.2f}", f"{100.0 * s.chance_of_best:.0f} %",
         f"{s.unstable} of {s.cases}", _gate(s, proven)]
        for s in found
    ]  # fmt: skip
    return columns, rows


def _gate(s: Standing, proven: set[str]) -> str:
    if not s.safe:
        return f"unsafe: {s.why_unsafe[0]}"
    return "safe" if s.controller in proven else "stable in simulation, not proven (no pure law)"


def short_table(found: Sequence[Verdict]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows of the verdicts on the nominal plant, one row per plant and causality."""
    columns = ["plant", "causality", "controller", "error", "map error", "dB", "deg", "verdict"]
    rows: list[list[object]] = [
        [v.plant, v.causality, v.controller, _percent(v.error), _factor(v.factor),
         _number(v.worst_magnitude_dB), _number(v.worst_phase_deg), v.short]
        for v in found
    ]  # fmt: skip
    return columns, rows


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.1f} %"


def _factor(factor: float | None) -> str:
    return "-" if factor is None else f"{factor:.1f} x"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
