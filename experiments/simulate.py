"""steer-env simulate: the virtual test vehicle drives the paper's manoeuvres into a campaign.

Writes campaign.toml and runs/*.csv, and truth.json beside them: what an identification of this
campaign should find. Nothing that identifies reads truth.json.
"""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

import steer_env
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.hidden_campaign import (
    MANOEUVRES_DRIVEN,
    SHARES,
    Present,
    answer_path,
    hidden_campaign,
    parse_hidden,
    write_answer,
)
from steer_env import atomic
from steer_env.errors import InputError
from steer_env.plants.model_file import read_model
from steer_env.testcar import truth
from steer_env.testcar.bench import bench_campaign, bench_for
from steer_env.testcar.campaign_writer import campaign_toml, run_file, write_run
from steer_env.testcar.drive import drive, generator_of
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import SPEEDS_KMH, PlannedRun, runs_at
from steer_env.testcar.variants import plain_car, random_car

LOWEST_KMH, HIGHEST_KMH = 5.0, 180.0
_SOURCES = ("physics", "manoeuvres", "testcar")
_SHOWN = (
    "speed_kmh",
    "J_ref_kgm2",
    "b_ref_Nms_per_rad",
    "k_gain",
    "n_t_m",
    "C_f_N_per_rad",
    "C_r_N_per_rad",
    "c_pin_on_Nm_per_rad",
    "c_pin_off_Nm_per_rad",
    "M_fric_C_Nm",
)


class Order(NamedTuple):
    """What the user asked for."""

    speeds_kmh: tuple[float, ...]
    repeats: int
    seed: int
    clean: bool


def parse_speeds(
    _context: click.Context, _parameter: click.Parameter, text: str
) -> tuple[float, ...]:
    """Speeds in km/h from a comma-separated list."""
    try:
        speeds = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise click.BadParameter(f"'{text}' is not a list of km/h such as 105,75,45") from None
    for speed in speeds:
        if not LOWEST_KMH <= speed <= HIGHEST_KMH:
            raise click.BadParameter(
                f"{speed:g} km/h is outside {LOWEST_KMH:g} to {HIGHEST_KMH:g} km/h"
            )
    if len(set(speeds)) != len(speeds):
        raise click.BadParameter("a speed is given twice")
    return speeds


def recipe(order: Order, car: VirtualCar) -> str:
    """Name of everything that the campaign depends on: order, car and the equations themselves."""
    digest = hashlib.sha256(repr((steer_env.__version__, order, car)).encode())
    root = Path(inspect.getfile(steer_env)).parent
    for package in _SOURCES:
        for path in sorted((root / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def drive_speed(
    speed_kmh: float, order: Order, car: VirtualCar, folder: Path, advance: Callable[..., None]
) -> tuple[list[PlannedRun], dict[str, Any]]:
    """Drive and write what is missing of one speed; return its runs and its true row."""
    runs = runs_at(speed_kmh, order.repeats, car)
    for run in runs:
        path = folder / run_file(run)
        if not path.exists():
            write_run(path, drive(run, car, None if order.clean else generator_of(run, order.seed)))
        advance(note=f"{speed_kmh:g} km/h")
    amplitude = {run.manoeuvre: run.amplitude for run in runs}
    row = truth.truth_at(speed_kmh, amplitude["steady_state"], amplitude["frequency_response"], car)
    advance(note=f"{speed_kmh:g} km/h, truth")
    return runs, row


def simulate(
    order: Order, car: VirtualCar, folder: Path, jobs: int, advance: Callable[..., None]
) -> dict[str, Any]:
    """Drive all speeds into ``folder`` and return the content of truth.json.

    ``folder`` may hold runs of an interrupted call; they are kept.
    """
    pool = ThreadPoolExecutor(max_workers=jobs)  # the compiled runs release the interpreter's lock
    try:
        waiting = {
            pool.submit(drive_speed, v, order, car, folder, advance): v for v in order.speeds_kmh
        }
        done = {waiting[future]: future.result() for future in as_completed(waiting)}
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    runs = [run for v in order.speeds_kmh for run in done[v][0]]
    name = f"virtual test vehicle, seed {order.seed}{', clean' if order.clean else ''}"
    atomic.write_text(folder / "campaign.toml", campaign_toml(name, car, runs))
    files = {
        run_file(run): hashlib.sha256((folder / run_file(run)).read_bytes()).hexdigest()
        for run in runs
    }
    content = {
        "schema_version": 1,
        "definitions": inspect.cleandoc(truth.__doc__ or ""),
        "rows": [done[v][1] for v in sorted(order.speeds_kmh)],
        "provenance": {
            "recipe": recipe(order, car),
            "software": f"steer-env {steer_env.__version__}",
            "files": files,
        },
    }
    atomic.write_text(folder / "truth.json", json.dumps(content, indent=2) + "\n")
    return content


def finished(out: Path, key: str) -> dict[str, Any] | None:
    """truth.json of a complete campaign of this recipe, None where something differs."""
    try:
        content: dict[str, Any] = json.loads((out / "truth.json").read_text("utf-8"))
        provenance = content["provenance"]
        if provenance["recipe"] != key or not (out / "campaign.toml").exists():
            return None
        for file, digest in provenance["files"].items():
            if hashlib.sha256((out / file).read_bytes()).hexdigest() != digest:
                return None
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return content


@click.command()
@click.option(
    "--speeds",
    "speeds_kmh",
    default=",".join(f"{v:g}" for v in SPEEDS_KMH),
    show_default=True,
    callback=parse_speeds,
    metavar="KMH,...",
    help="Speeds in km/h.",
)
@click.option(
    "--repeats",
    type=click.IntRange(1, 50),
    default=3,
    show_default=True,
    metavar="N",
    help="Sweeps per speed.",
)
@click.option(
    "--clean", is_flag=True, help="No disturbance, noise, latency or rounding in the logs."
)
@click.option(
    "--hide",
    "hidden",
    multiple=True,
    metavar="NAME[=VALUE]",
    help="Hide an effect of the catalogue in a plain car for a blind test of 'gap' (repeatable): NAME, NAME=VALUE, "
    "NAME:parameter=value,... or none, random. The answer is sealed in OUT.answer.json beside the folder.",
)
@click.option(
    "--model",
    type=click.Path(path_type=Path),
    help="A model.json of 'gap': a plain car with its effects in it is driven, openly.",
)
@click.option(
    "--manoeuvres",
    default=",".join(MANOEUVRES_DRIVEN),
    show_default=True,
    metavar="NAME,...",
    help=f"With --hide: what is driven, of {', '.join(('frequency_response', *SHARES))}.",
)
@click.option("--vehicle", type=click.Choice(["plain", "random"]), default="plain", help="With --hide: the car.")
@click.option(
    "--kind",
    type=click.Choice(["vehicle", "rig"]),
    default="vehicle",
    show_default=True,
    help="With --hide: a car, or a force-feedback motor on a bench with its own catalogue.",
)
@common_options
def command(
    speeds_kmh: tuple[float, ...],
    repeats: int,
    clean: bool,
    hidden: tuple[str, ...],
    model: Path | None,
    manoeuvres: str,
    vehicle: str,
    kind: str,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Drive the virtual test vehicle through the paper's manoeuvres and write a campaign."""
    if kind == "rig":
        _hide_in_bench(hidden or ("none",), seed, repeats, out, as_json)
        return
    blind = Order(speeds_kmh, repeats, seed, clean)
    if model is not None:
        effects = {name: dict(values) for name, values in read_model(model).effects.items()}
        _drive_plain(effects, blind, manoeuvres, vehicle, out, jobs, quiet)
        click.echo(f"{out / 'campaign.toml'}")
        return
    if hidden:
        present = parse_hidden(hidden, seed)
        _drive_plain(present, blind, manoeuvres, vehicle, out, jobs, quiet)
        write_answer(out, present, seed)
        _say_where(out, as_json)
        return
    order, car = Order(speeds_kmh, repeats, seed, clean), VirtualCar()
    key = recipe(order, car)
    content = finished(out, key)
    if content is None:
        steps = len(speeds_kmh) * (len(runs_at(speeds_kmh[0], repeats, car)) + 1)
        with (
            progress("simulate", total=steps, quiet=quiet) as advance,
            atomic.folder(out, key) as folder,
        ):
            content = simulate(order, car, folder, jobs, advance)
    if as_json:
        print_json({"campaign": str(out / "campaign.toml"), "rows": content["rows"]})
        return
    print_table(
        _SHOWN, [[row[name] for name in _SHOWN] for row in content["rows"]], title="true parameters"
    )
    click.echo(f"{out / 'campaign.toml'}")


def _drive_plain(
    present: Present, order: Order, manoeuvres: str, vehicle: str, out: Path, jobs: int, quiet: bool
) -> None:
    """Write the campaign of a plain car with effects in it; nothing in it tells which."""
    driven = tuple(manoeuvres.split(","))
    known = ("frequency_response", *SHARES)
    for name in driven:
        if name not in known:
            raise InputError("--manoeuvres", f"there is no manoeuvre '{name}'", f"give some of {', '.join(known)}")
    if order.clean:
        raise InputError("--clean", "a campaign without noise has no noise to judge by", "leave --clean away")
    if (out / "truth.json").exists():
        raise InputError(str(out), "this folder holds a campaign that tells its truth", "give another --out")
    car = random_car(np.random.default_rng(order.seed)) if vehicle == "random" else plain_car()
    total = len(driven) * order.repeats * len(order.speeds_kmh)
    key = hashlib.sha256(repr((order, present, driven, vehicle)).encode()).hexdigest()[:16]
    with progress("simulate", total=total, quiet=quiet) as advance, atomic.folder(out, key) as folder:
        (folder / "runs").mkdir(exist_ok=True)
        hidden_campaign(folder, present, car, order.seed, order.speeds_kmh, order.repeats, driven, jobs, advance)


def _hide_in_bench(texts: tuple[str, ...], seed: int, repeats: int, out: Path, as_json: bool) -> None:
    """The same for the virtual bench."""
    present = parse_hidden(texts, seed, "rig")
    with atomic.folder(out) as folder:
        bench_campaign(folder, present, seed, repeats, bench_for(present, seed))
    write_answer(out, present, seed)
    _say_where(out, as_json)


def _say_where(out: Path, as_json: bool) -> None:
    if as_json:
        print_json({"campaign": str(out / "campaign.toml"), "answer": str(answer_path(out))})
        return
    click.echo(f"{out / 'campaign.toml'}")
    click.echo(f"the answer is sealed in {answer_path(out)}")
