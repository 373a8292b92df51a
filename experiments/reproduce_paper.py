"""steer-env reproduce-paper: the paper's Figures 5 to 11 and Tables 2 and 3 beside ours.

Writes report.html and figures.json; campaign/ and identified.json stay beside them, so that a second call only draws.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiments.cli_options import common_options, print_json, print_table, progress
from steer_env import atomic

if TYPE_CHECKING:
    from experiments.paper_results import Results


@click.command()
@common_options
def command(out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Lay the published figures and tables beside ours."""
    from experiments.paper_numbers import document, summary
    from experiments.report.paper import write_paper_report

    results = reproduce(out, seed, jobs, quiet)
    report = write_paper_report(results, out / "report.html", seed)
    atomic.write_text(out / "figures.json", json.dumps(document(results), allow_nan=False) + "\n")
    if as_json:
        print_json({"report": str(report), "figures": str(out / "figures.json"), **summary(results)})
        return
    _print_statements(results)
    click.echo(f"{report}")


def reproduce(out: Path, seed: int, jobs: int, quiet: bool) -> Results:
    """Simulate and identify our car into ``out`` (or reuse what is there), and execute the published rows."""
    from experiments.paper_closed_loops import closed_loops
    from experiments.paper_identified import our_car, steps_of_our_car
    from experiments.paper_published import execute
    from experiments.paper_results import Results
    from steer_env.plants import Reference

    published, complete = Reference(linear=True), Reference()
    speeds = [row.speed_kmh for row in published.file.rows]
    with progress("reproduce-paper", total=steps_of_our_car() + len(speeds) + 1, quiet=quiet) as advance:
        car = our_car(out, seed, jobs, advance)
        executed = []
        for speed_kmh in speeds:
            executed.append(execute(speed_kmh, complete))
            advance(note=f"published row, {speed_kmh:g} km/h")
        loops = closed_loops(seed)
        advance(note="controllers")
    return Results(published, executed, car, loops)


def _print_statements(results: Results) -> None:
    def short(row: dict, name: str) -> str:
        finding = row["findings"].get(name)
        return "–" if finding is None else f"{finding.verdict}: {finding.numbers}"

    rows = [[row["says"], short(row, "published"), short(row, "printed")] for row in results.statements()]
    print_table(("the paper says", "published rows", "our car, the paper's steps as printed"), rows)
