"""Train a torque policy: steer-env train TASK --out DIR.

Everything that is learned from is drawn from the benchmark's training seeds; its test seeds are never touched.
"""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import click

import controllers
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.learning.config import ALGORITHMS, FULL_TORQUE, TrainConfig
from experiments.learning.scoring import Score, classical_scores
from steer_env.errors import InputError
from steer_env.plants import PLANTS, Reference


def config_of(task: str, seed: int, settings: dict[str, str]) -> TrainConfig:
    """The configuration of a task such as "SbW-Impedance" or "steer_env/SbW-Impedance-v0"."""
    name = task.removeprefix("steer_env/").removesuffix("-v0")
    plant, _, causality = name.partition("-")
    known = [f"{p}-{c.capitalize()}" for p in PLANTS for c in controllers.CAUSALITIES]
    if f"{plant}-{causality.capitalize()}" not in known:
        raise InputError("TASK", f"{task!r} is not known", f"use one of {', '.join(known)}")
    return replace(TrainConfig(plant, causality.lower(), seed), seed=seed).changed(settings)


def rivals(config: TrainConfig) -> dict[str, Score]:
    """Training-split scores of the base law and of pid."""
    reference = Reference.load(config.domain.references[0])
    names = dict.fromkeys([config.action.base, "pid"])
    return classical_scores([n for n in names if n != FULL_TORQUE], config.plant, config.causality, reference)


def seeds_in(text: str) -> list[int]:
    """The seeds of a list such as "0,1,2"; InputError where it is something else."""
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isdigit() for part in parts) or len(set(parts)) < len(parts):
        raise InputError("--seeds", f"{text!r} is no list of different seeds", "give whole numbers such as 0,1,2")
    return [int(part) for part in parts]


@click.command()
@click.argument("task")
@click.option("--algorithm", type=click.Choice(ALGORITHMS), help="[default: ppo]")
@click.option("--base", metavar="NAME", help='Law that the policy corrects; "none": it gives the whole torque.')
@click.option("--steps", type=click.IntRange(min=1), metavar="N", help="Steps of the policy in all. [default: 800000]")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Any other, e.g. learning.gamma=0.9.")
@click.option("--seeds", metavar="N,N...", help="Train each of these seeds, in DIR/seed_N, instead of --seed.")
@click.option("--search", "trials", default=0, metavar="N", help="Try N settings in short runs first.")
@click.option("--ray", metavar="ADDRESS", help='Seeds and trials over a Ray cluster; "auto": the one that runs here.')
@click.option("--snapshots", default=0.0, metavar="S", help="Keep the policy every S CPU seconds too.")
@common_options
def command(
    task: str,
    algorithm: str | None,
    base: str | None,
    steps: int | None,
    settings: tuple[str, ...],
    seeds: str | None,
    trials: int,
    ray: str | None,
    snapshots: float,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Train a torque policy for TASK (EPAS-Impedance, SbW-Admittance ...).

    Writes policy.safetensors and policy.json, a TensorBoard log and a checkpoint every minute: the same
    command goes on where an interrupted one was. Several seeds, or trials of a search, run --jobs at a time, or over a
    Ray cluster. Needs the extra [learn]; a search [tune] too.
    """
    given = {"learning.algorithm": algorithm, "action.base": base, "learning.steps": steps}
    changes = {name: str(value) for name, value in given.items() if value is not None}
    for text in settings:
        name, separator, value = text.partition("=")
        if not separator:
            raise InputError("--set", f"{text!r} has no value", "give NAME=VALUE")
        changes[name] = value
    config = config_of(task, seed, changes)
    _there("stable_baselines3", "learn")
    from experiments.learning import fleet

    chosen = [seed] if seeds is None else seeds_in(seeds)
    if trials:
        config = config.changed(searched(config, trials, out / "search", jobs, ray, quiet))
    folders = [out] if seeds is None else [out / f"seed_{k}" for k in chosen]
    runs = {folder: replace(config, seed=k) for folder, k in zip(folders, chosen, strict=True)}
    with progress(f"train {task}", total=len(runs) * config.learning.steps, quiet=quiet) as advance:
        trained = fleet.trained(runs, jobs, ray, advance, snapshots)
    names = ["policy"] if seeds is None else [f"policy, seed {k}" for k in chosen]
    found = rivals(config) | dict(zip(names, trained.values(), strict=True))
    if as_json:
        print_json({name: score._asdict() for name, score in found.items()})
        return
    rows = [[name, score.jnd, score.mean, f"{score.unstable} of {score.cases}"] for name, score in found.items()]
    print_table(["controller", "JND", "mean JND", "unstable"], rows, title=f"{task}, the benchmark's training split")
    for folder in folders:
        click.echo(f"Policy: {folder / 'policy.json'}")


def searched(config: TrainConfig, trials: int, folder: Path, jobs: int, ray: str | None, quiet: bool) -> dict[str, str]:
    """Settings found by ``trials`` short runs; they are told on stderr as options of the command."""
    _there("optuna", "tune")
    from experiments.learning import fleet
    from experiments.learning.search import search, short  # Optuna loads when it is asked for

    total = trials * short(config).learning.steps
    with progress(f"search {config.plant}-{config.causality.capitalize()}", total=total, quiet=quiet) as advance:
        settings = search(config, trials, folder, lambda runs: fleet.trained(runs, jobs, ray, advance))
    if not quiet:
        click.echo("Found: " + " ".join(f"--set {name}={value}" for name, value in settings.items()), err=True)
    return settings


def _there(package: str, extra: str) -> None:
    """InputError where a package is missing that an extra of this one brings."""
    if find_spec(package) is None:
        what, mend = f"{package} is not installed", f'install it: pip install "steer-env[{extra}]"'
        raise InputError("steer-env train", what, mend)
