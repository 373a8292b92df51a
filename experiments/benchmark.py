"""Score controllers on plants x references x manoeuvres: steer-env benchmark.

Every case is one compiled episode whose noise follows from the seed and the case's name: the same
bits whatever --jobs. Results are kept one by one in OUT/cases, under a key made from everything
they depend on, so an interrupted run resumes and a changed controller is run anew.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import click

from experiments import bench_cases
from experiments.bench_cases import Case
from experiments.bench_verdict import Verdict, verdicts
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.metrics import METRICS
from steer_env import __version__, atomic
from steer_env.plants import Reference

SCHEMA_VERSION = 1

Result = dict[str, Any]


def benchmark(
    cases: Sequence[Case],
    reference: Reference | None = None,
    seed: int = 0,
    jobs: int = 1,
    store: Path | None = None,
    advance: Callable[..., None] = lambda **_: None,
) -> list[Result]:
    """Results in the order of the cases: case, stable, scores by metric name, plot data.

    Compiled episodes run outside Python's lock, so threads share one compilation. ``store`` keeps
    finished cases and takes what is already there.
    """
    chosen = reference or Reference.load("published")

    def one(case: Case) -> Result:
        kept = _path(store, case, chosen, seed)
        if kept is not None and kept.exists():
            result: Result = json.loads(kept.read_text("utf-8"))
            return result
        result = bench_cases.result_of(case, chosen, seed)
        if kept is not None:
            atomic.write_text(kept, json.dumps(result, allow_nan=False))
        return result

    pool = ThreadPoolExecutor(jobs)
    try:
        waiting = {pool.submit(one, case): case for case in cases}
        for done in as_completed(waiting):
            done.result()
            advance(note=waiting[done].name)
        return [future.result() for future in waiting]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _path(store: Path | None, case: Case, reference: Reference, seed: int) -> Path | None:
    if store is None:
        return None
    return store / f"{case.name}-{bench_cases.key_of(case, reference, seed)}.json"


@click.command()
@click.option(
    "--reference",
    "source",
    default="published",
    show_default=True,
    metavar="FILE",
    help='A reference.json, or "published".',
)
@click.option("--quick", is_flag=True, help="Only 75 km/h and the relaxed arm.")
@common_options
def command(
    source: str, quick: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool
) -> None:
    """Score controllers on tracking a reference.

    EPAS and steer-by-wire, impedance and admittance, 45, 75 and 105 km/h, chirp and 0.2 Hz sine,
    relaxed and tense arm; at 75 km/h also against the linear reference (the paper's Figure 9).
    Writes scores.json, scores.csv and report.html.
    """
    reference = Reference.load(source)
    speeds, arms = ((75.0,), ("relaxed",)) if quick else (bench_cases.SPEEDS_KMH, bench_cases.ARMS)
    cases = bench_cases.grid(speeds_kmh=speeds, arms=arms)
    with progress("benchmark", total=len(cases), quiet=quiet) as advance:
        results = benchmark(cases, reference, seed, jobs, out / "cases", advance)
    summary = write_scores(out, results, source, seed)
    if as_json:
        print_json({k: v for k, v in summary.items() if k != "results"})
    else:
        print_table(*short_table(verdicts(results)), title=f"Report: {out / 'report.html'}")


def write_scores(out: Path, results: Sequence[Result], source: str, seed: int) -> dict[str, Any]:
    """scores.json, scores.csv and report.html, each whole or not at all; returns the first's content."""
    from experiments.report.benchmark import make_report  # plotly loads when something is drawn

    found = verdicts(results)
    summary = {
        "schema_version": SCHEMA_VERSION,
        "software_version": __version__,
        "reference": source,
        "seed": seed,
        "verdicts": [verdict._asdict() for verdict in found],
        "metrics": {name: {"unit": m.unit, "meaning": m.meaning} for name, m in METRICS.items()},
        "results": [{k: v for k, v in result.items() if k != "plot"} for result in results],
    }
    atomic.write_text(out / "scores.json", json.dumps(summary, indent=1, allow_nan=False) + "\n")
    atomic.write_text(out / "scores.csv", csv_of(results))
    make_report(results, found, source, seed).write(out / "report.html")
    return summary


def csv_of(results: Sequence[Result]) -> str:
    """One line per case: what it is, whether it was stable, every metric (empty: not defined)."""
    fields = list(Case.__dataclass_fields__)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*fields, "stable", *METRICS])
    for result in results:
        scores = [result["scores"].get(name) for name in METRICS]
        row = [result["case"][field] for field in fields]
        writer.writerow([*row, result["stable"], *("" if v is None else repr(v) for v in scores)])
    return text.getvalue()


def short_table(found: Sequence[Verdict]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows of the table on stdout, one row per plant and causality."""
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
