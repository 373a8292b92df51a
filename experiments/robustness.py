"""Proof before score: what a controller's loops survive, from linear models: steer-env robustness.

    python -m experiments.robustness --quick --controller pid

``assess`` (experiments.assessment) finds growth and margins of every plant, causality, speed,
operating point and arm; ``safe`` (experiments.stability_gate) makes a gate of them, and the
worst places are simulated (experiments.loop_simulation).
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click

import controllers
from experiments.arm_radius import SCALES
from experiments.assessment import Assessment, Make, assess
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.linear_loop import AT_REST
from experiments.loop_simulation import Confirmation, confirm, worst_stuck
from experiments.margins import DELAY_LIMIT, GAIN_LIMIT_dB
from experiments.stability_gate import Gate, safe
from experiments.worker_pool import worker_pool
from steer_env import __version__, atomic
from steer_env.plants import PLANTS, Reference

__all__ = ["Assessment", "Gate", "assess", "command", "safe"]

SCHEMA_VERSION = 1
QUICK_KMH = 75.0


class System(NamedTuple):
    """What one process works on: all controllers on one plant and causality."""

    plant: str
    causality: str
    names: tuple[str, ...]
    source: str | Reference
    speeds_kmh: tuple[float, ...]


class Findings(NamedTuple):
    """Of one controller on one plant and causality."""

    controller: str
    assessments: list[Assessment]
    confirmation: Confirmation


def findings(system: System) -> list[Findings]:
    """Assess the controllers one after the other and simulate the worst place of each."""
    reference = Reference.load(system.source)
    return [
        findings_of(name, partial(controllers.make, name), system.plant, system.causality, reference, system.speeds_kmh)
        for name in system.names
    ]


def findings_of(
    name: str, make: Make, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float]
) -> Findings:
    """Of one controller, under the name that it is told by."""
    values = assess(make, plant, causality, reference, speeds_kmh)
    controller = make(PLANTS[plant], reference, causality)
    return Findings(name, values, confirm(controller, PLANTS[plant], reference, worst_stuck(values)))


@click.command()
@click.option("--reference", "source", default="published", show_default=True, metavar="FILE",
              help='A reference.json, or "published".')  # fmt: skip
@click.option("--controller", "names", multiple=True, type=click.Choice(list(controllers.CONTROLLERS)),
              help="Only this one; may be given several times.")  # fmt: skip
@click.option("--quick", is_flag=True, help=f"Only {QUICK_KMH:g} km/h.")
@common_options
def command(
    source: str, names: tuple[str, ...], quick: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool
) -> None:
    """Prove controllers stable before they are scored.

    Growth, gain, phase, disk and delay margins, arms and passivity of every loop: EPAS and
    steer-by-wire, impedance and admittance, all speeds of the reference, on centre and where the
    assist is steepest, friction stuck and sliding, all arms. Nothing in it is random. Writes
    robustness.json.
    """
    speeds = [row.speed_kmh for row in Reference.load(source).file.rows]
    chosen = (QUICK_KMH,) if quick else tuple(speeds)
    chosen_names = names or tuple(controllers.CONTROLLERS)
    systems = [
        System(plant, causality, chosen_names, source, chosen)
        for plant, causality in product(PLANTS, controllers.CAUSALITIES)
    ]
    with progress("robustness", total=len(systems), quiet=quiet) as advance:
        found: list[list[Findings]] = []
        for done in each_system(systems, jobs):
            found.append(done)
            advance(note=done[0].confirmation.plant)
    summary = summary_of(found, source)
    atomic.write_text(out / "robustness.json", json.dumps(summary, indent=1, allow_nan=False) + "\n")
    if as_json:
        print_json({k: v for k, v in summary.items() if k != "assessments"})
    else:
        print_table(*short_table(found), title=f"All values: {out / 'robustness.json'}")


def each_system(systems: Sequence[System], jobs: int) -> Iterator[list[Findings]]:
    """Findings of each system in turn, by ``jobs`` processes."""
    if jobs == 1:
        yield from map(findings, systems)
        return
    # Small matrices: threads inside each process would only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with worker_pool(min(jobs, len(systems))) as pool:
        yield from pool.map(findings, systems)


def summary_of(found: Sequence[Sequence[Findings]], source: str) -> dict[str, Any]:
    """What robustness.json holds: gates, assessments and confirmations, as lists of plain records."""
    every = [one for system in found for one in system]
    return {
        "schema_version": SCHEMA_VERSION,
        "software_version": __version__,
        "reference": source,
        "limits": {
            "gain_margin_dB": GAIN_LIMIT_dB,
            "delay_margin_ms": 1e3 * DELAY_LIMIT,
            "arm_radius": max(SCALES),
            "slowest_mode_per_s": AT_REST,
        },
        "gates": [
            {"controller": f.controller, "plant": f.confirmation.plant, "causality": f.confirmation.causality,
             **safe(f.assessments)._asdict()}
            for f in every
        ],
        "confirmations": [{"controller": f.controller, **f.confirmation._asdict()} for f in every],
        "assessments": [{"controller": f.controller, **a._asdict()} for f in every for a in f.assessments],
    }  # fmt: skip


def short_table(found: Sequence[Sequence[Findings]]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows of the table on stdout: one row per controller, plant and causality."""
    columns = ["plant", "causality", "controller", "1/s", "GM dB", "PM deg", "disk", "delay ms", "arm x",
               "gap Nms/rad", "verdict"]  # fmt: skip
    rows: list[list[object]] = []
    for f in (one for system in found for one in system):
        gate = safe(f.assessments)
        verdict = "safe" if gate.safe else f"unsafe at {len(gate.failures)}: {gate.failures[0].split(', ', 1)[1]}"
        rows.append(
            [f.confirmation.plant, f.confirmation.causality, f.controller, *(f"{v:.1f}" for v in gate[3:6]),
             f"{gate.disk_margin:.2f}", f"{gate.delay_margin_ms:.1f}", f"{gate.arm_radius:.2f}",
             f"{gate.bar_passivity_gap:.1f}", verdict]
        )  # fmt: skip
    return columns, rows


if __name__ == "__main__":
    command()
