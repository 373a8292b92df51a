"""The main job in one go, on what the package ships: steer-env demo.

A virtual test vehicle is measured, its haptic reference identified, environments made of the
reference, two controllers scored on tracking it, and the result laid out on one page:

    OUT/campaign      the measurement, as steer-env simulate writes it
    OUT/identified    reference.json and its report, as steer-env identify writes them
    OUT/benchmark     scores and their report, as steer-env benchmark writes them
    OUT/report.html   the page that sums it up

What is finished is kept: an interrupted demo goes on where it stopped.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from experiments import bench_cases, bench_scores, identify, simulate
from experiments.bench_run import run_cases
from experiments.bench_verdict import verdicts
from experiments.cli_options import common_options, print_json, print_table, progress
from steer_env import atomic
from steer_env.plants import Reference
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import runs_at

SPEEDS_KMH = (105.0, 75.0, 45.0)
REPEATS = 3
TRACKED_KMH = 75.0
ARM = "relaxed"
CONTROLLERS = ("open_loop_map", "pid")
JUDGED = ("C_f", "C_r", "n_t", "J_ref", "b_ref", "k_gain", "c_pin_off", "M_fric_C")


@click.command()
@common_options
def command(out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Measure a virtual car, identify its haptic reference, control a wheel to feel like it."""
    from experiments.report.demo import write_demo_report  # plotly loads when something is drawn
    from identification.campaign import read_campaign
    from identification.identify import MODES, Options

    order, car = simulate.Order(SPEEDS_KMH, REPEATS, seed, False), VirtualCar()
    cases = bench_cases.grid(CONTROLLERS, speeds_kmh=(TRACKED_KMH,), arms=(ARM,))
    runs = len(SPEEDS_KMH) * (len(runs_at(TRACKED_KMH, REPEATS, car)) + 1)
    total = runs + 2 * len(SPEEDS_KMH) + 1 + len(cases) + 1
    with progress("demo", total=total, quiet=quiet) as advance:
        _measure(order, car, out / "campaign", runs, jobs, advance)
        campaign = read_campaign(out / "campaign")
        found = identify.identify_into(out / "identified", campaign, Options(MODES), jobs, advance)
        reference = Reference.load(out / "identified" / "reference.json")
        store = out / "benchmark" / "cases"
        results = run_cases(cases, reference, seed, jobs, store, advance)
        bench_scores.write_scores(out / "benchmark", results, reference.source, seed, {}, {})
        truth = json.loads((out / "campaign" / "truth.json").read_text("utf-8"))["rows"]
        judged = judgement(found, truth)
        write_demo_report(out, found, judged, results, seed)
        advance(note="report")
    if as_json:
        print_json({"identified": judged, "report": str(out / "report.html")})
        return
    print_table(["km/h", *JUDGED], _beside(judged), title="reference: identified (true)")
    print_table(*bench_scores.short_table(verdicts(results)), title="tracking it at 75 km/h, relaxed arm")
    click.echo(f"report: {out / 'report.html'}")


def _measure(
    order: simulate.Order,
    car: VirtualCar,
    folder: Path,
    steps: int,
    jobs: int,
    advance: Callable[..., None],
) -> None:
    key = simulate.recipe(order, car)
    if simulate.finished(folder, key) is not None:
        advance(steps, note="campaign kept")
        return
    with atomic.folder(folder, key) as staging:
        simulate.simulate(order, car, staging, jobs, advance)


def judgement(found: Any, truth: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Identified beside true, one row per speed and parameter of JUDGED."""
    from steer_env.plants.reference_file import ROW_KEYS

    rows = []
    for result in next(iter(found.modes.values())):
        true = next(row for row in truth if row["speed_kmh"] == result.speed_kmh)
        for name in JUDGED:
            if name in result.values:
                rows.append(
                    {
                        "speed_kmh": result.speed_kmh,
                        "name": name,
                        "true": true[ROW_KEYS[name]],
                        "value": result.values[name],
                        "std": result.std.get(name, 0.0),
                    }
                )
    return rows


def _beside(judged: list[dict[str, Any]]) -> list[list[str]]:
    """One line per speed: identified (true) of each parameter, a dash where it was not identified."""
    lines = []
    for speed in dict.fromkeys(row["speed_kmh"] for row in judged):
        here = {row["name"]: row for row in judged if row["speed_kmh"] == speed}
        cells = [f"{_short(here[n]['value'])} ({_short(here[n]['true'])})" if n in here else "-" for n in JUDGED]
        lines.append([f"{speed:g}", *cells])
    return lines


def _short(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
