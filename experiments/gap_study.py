"""A blind study of the gap workflow: effects hidden in virtual cars of which the workflow sees the campaign alone.

python -m experiments.gap_study --cases 96 --out outputs/gap_study

Every case is another car, other parameters, other noise; amplitudes are log-uniform over the plausible range, so some
cannot be seen. The cars are richer than the nominal model. Seeds below REPORTED were for choosing rules and for the
calibration of probabilities; what is reported comes from seeds from there on.
"""

from __future__ import annotations

import importlib.util
import json
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.gap_baseline import baseline_name
from experiments.gap_study_figures import write_study_report
from experiments.gap_study_summary import summary
from experiments.hidden_campaign import Present, drawn_parameters, hidden_campaign
from experiments.worker_pool import worker_pool
from steer_env import atomic
from steer_env.physics.effects import EFFECTS
from steer_env.testcar.variants import random_car

REPORTED = 10_000  # first seed of what is reported
SPEEDS_KMH = (30.0, 60.0, 100.0)
Columns = dict[str, np.ndarray]


class Degraded(NamedTuple):
    """A campaign that holds less than one would wish."""

    repeats: int = 3
    manoeuvres: tuple[str, ...] = ("frequency_response", "steady_state", "on_centre_weave")
    dropped: tuple[str, ...] = ()
    noise: float = 1.0


DEGRADED = {
    "full": Degraded(),
    "one run each": Degraded(repeats=1),
    "only sweeps": Degraded(manoeuvres=("frequency_response",)),
    "no rack force": Degraded(dropped=("rack_force_N", "lateral_speed_mps", "sideslip_angle_rad")),
    "double noise": Degraded(noise=2.0),
}


def _drifting_torque(c: Columns, size: float) -> None:
    c["torsion_bar_torque_Nm"] += 0.6 * size * c["time_s"] / c["time_s"][-1]


def _clipped_torque(c: Columns, size: float) -> None:
    limit = np.abs(c["torsion_bar_torque_Nm"]).max() * (1.0 - 0.3 * size)
    np.clip(c["torsion_bar_torque_Nm"], -limit, limit, out=c["torsion_bar_torque_Nm"])


def _curved_yaw_sensor(c: Columns, size: float) -> None:
    yaw = c["yaw_rate_radps"]
    yaw += 0.25 * size * np.abs(yaw) * yaw / max(float(np.abs(yaw).max()), 1e-9)


def _one_sided_rack_force(c: Columns, size: float) -> None:
    c["rack_force_N"] += 0.15 * size * np.maximum(c["rack_force_N"], 0.0)


# What the catalogue does not hold, put into the logged columns by a size from 0.5 to 2.
OUTSIDE: dict[str, Callable[[Columns, float], None]] = {
    "drifting torque sensor": _drifting_torque,
    "clipped torque sensor": _clipped_torque,
    "curved yaw sensor": _curved_yaw_sensor,
    "one-sided rack force": _one_sided_rack_force,
}


class Case(NamedTuple):
    """One blind campaign: what is hidden, and how good the campaign is."""

    seed: int
    kind: str  # single, none, pair, outside
    hidden: Present
    outside: str
    size: float
    campaign: str


def case_of(index: int, first_seed: int) -> Case:
    """Case ``index``: singles in turn, one in six nothing, one in eight from outside, one in seven a pair."""
    seed = first_seed + index
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(41,)))
    table = EFFECTS["vehicle"]
    names = list(table)
    campaign = "full" if index % 4 else str(rng.choice([name for name in DEGRADED if name != "full"]))
    size = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    if index % 6 == 5:
        return Case(seed, "none", {}, "", size, campaign)
    if index % 8 == 6:
        return Case(seed, "outside", {}, str(rng.choice(list(OUTSIDE))), size, campaign)
    if index % 7 == 3:
        chosen = rng.choice(names, 2, replace=False)
        return Case(seed, "pair", {str(n): drawn_parameters(table[n], rng) for n in chosen}, "", size, campaign)
    name = names[(seed * 5 + 3) % len(names)]
    return Case(seed, "single", {name: drawn_parameters(table[name], rng)}, "", size, campaign)


def run_case(case: Case) -> dict[str, Any]:
    """Drive, analyse and describe one case; the analysis reads the folder and nothing else."""
    from identification.campaign import read_campaign
    from identification.gap.workflow import find_gap

    car = random_car(np.random.default_rng(np.random.SeedSequence(case.seed, spawn_key=(42,))))
    worse = DEGRADED[case.campaign]
    change = partial(_changed, case=case, worse=worse)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "campaign"
        (folder / "runs").mkdir(parents=True)
        hidden_campaign(folder, case.hidden, car, case.seed, SPEEDS_KMH, worse.repeats, worse.manoeuvres, change=change)
        campaign = read_campaign(folder)
        start = time.perf_counter()
        result = find_gap(campaign)
        seconds = time.perf_counter() - start
    document = result.document()
    return {
        "seed": case.seed,
        "kind": case.kind,
        "campaign": case.campaign,
        "hidden": case.hidden,
        "outside": case.outside,
        "size": case.size,
        "seconds": seconds,
        "baseline": _baseline(result),
        **{
            key: document[key] for key in ("verdict", "reason", "effects", "gap", "ranking", "second", "ambiguous_with")
        },
    }


def _baseline(result: Any) -> str | None:
    """What sparse regression would say; None where PySINDy is not installed (extra "study")."""
    if importlib.util.find_spec("pysindy") is None:
        return None
    return baseline_name(result)


def _changed(columns: Columns, rng: np.random.Generator, case: Case, worse: Degraded) -> Columns:
    """What the logger's columns are made into: noisier, poorer, or from outside the catalogue."""
    if worse.noise > 1.0:
        from steer_env.testcar.logger import CHANNELS

        for channel in CHANNELS:
            extra = channel.noise * np.sqrt(worse.noise**2 - 1.0)
            columns[channel.column] = columns[channel.column] + extra * rng.standard_normal(columns["time_s"].size)
    if case.outside:
        OUTSIDE[case.outside](columns, case.size)
    return {name: values for name, values in columns.items() if name not in worse.dropped}


def study(cases: list[Case], store: Path, jobs: int, advance: Callable[..., None]) -> list[dict[str, Any]]:
    """Run what is not in ``store`` (one JSON line per case) yet; returns all, by seed."""
    done = {}
    if store.exists():
        for line in store.read_text("utf-8").splitlines():
            entry = json.loads(line)
            done[entry["seed"]] = entry
    waiting = [case for case in cases if case.seed not in done]
    advance(len(cases) - len(waiting))
    with worker_pool(jobs) as pool:
        futures = [pool.submit(run_case, case) for case in waiting]
        for future in as_completed(futures):
            entry = future.result()
            done[entry["seed"]] = entry
            with store.open("a", encoding="utf-8") as file:
                file.write(json.dumps(entry) + "\n")
            advance(note=f"seed {entry['seed']}")
    return [done[case.seed] for case in cases]


@click.command()
@click.option("--cases", type=click.IntRange(1), default=96, show_default=True, metavar="N", help="Number of cases.")
@click.option("--tuning", is_flag=True, help="Use the tuning seeds instead of those that are reported.")
@common_options
def command(cases: int, tuning: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Blind study of the gap workflow: how often it names the right effect, a wrong one, or none."""
    first = seed + (0 if tuning else REPORTED)
    out.mkdir(parents=True, exist_ok=True)
    planned = [case_of(k, first) for k in range(cases)]
    with progress("gap study", total=cases, quiet=quiet) as advance:
        entries = study(planned, out / "cases.jsonl", jobs, advance)
    document = summary(entries)
    atomic.write_text(out / "study.json", json.dumps(document, indent=1) + "\n")
    write_study_report(entries, document, out / "report.html")
    if as_json:
        print_json(document)
        return
    print_table(("figure", "value", "of"), [[k, v["value"], v["of"]] for k, v in document["figures"].items()])
    click.echo(f"{out / 'report.html'}")


if __name__ == "__main__":
    command()
