"""Train a torque policy: steer-env train TASK --out DIR.

Everything that is learned from is drawn from the benchmark's training seeds; its test seeds are never touched.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

import controllers
from controllers import policy
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.learning.config import ALGORITHMS, FULL_TORQUE, TrainConfig
from experiments.learning.scoring import Score, training_score
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


def scores(config: TrainConfig, folder: Path) -> dict[str, Score]:
    """Training-split scores of the policy in a folder, of its base law and of pid."""
    reference = Reference.load(config.domain.references[0])
    names = dict.fromkeys([config.action.base, "pid"])
    makers: dict[str, Any] = {name: partial(controllers.make, name) for name in names if name != FULL_TORQUE}
    makers["policy"] = partial(policy.make, folder=folder)
    return {name: training_score(make, config.plant, config.causality, reference) for name, make in makers.items()}


@click.command()
@click.argument("task")
@click.option("--algorithm", type=click.Choice(ALGORITHMS), help="[default: ppo]")
@click.option("--base", metavar="NAME", help='Law that the policy corrects; "none": it gives the whole torque.')
@click.option("--steps", type=click.IntRange(min=1), metavar="N", help="Steps of the policy in all. [default: 800000]")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Any other, e.g. learning.gamma=0.9.")
@click.option("--search", "trials", default=0, metavar="N", help="Try N settings in short runs first.")
@click.option("--snapshots", default=0.0, metavar="S", help="Keep the policy every S CPU seconds too.")
@common_options
def command(
    task: str,
    algorithm: str | None,
    base: str | None,
    steps: int | None,
    settings: tuple[str, ...],
    trials: int,
    snapshots: float,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Train a torque policy for TASK (EPAS-Impedance, SbW-Admittance ...).

    Writes policy.safetensors and policy.json, a TensorBoard log and a checkpoint every minute: the same
    command goes on where an interrupted one was. Needs the extra [learn].
    """
    given = {"learning.algorithm": algorithm, "action.base": base, "learning.steps": steps}
    changes = {name: str(value) for name, value in given.items() if value is not None}
    for text in settings:
        name, separator, value = text.partition("=")
        if not separator:
            raise InputError("--set", f"{text!r} has no value", "give NAME=VALUE")
        changes[name] = value
    config = config_of(task, seed, changes)
    try:
        from experiments.learning.run import Run
    except ModuleNotFoundError as missing:
        what = f"{missing.name} is not installed"
        raise InputError("steer-env train", what, 'install it: pip install "steer-env[learn]"') from missing
    if trials:
        from experiments.learning.search import search  # Optuna loads when it is asked for

        with progress(f"search {task}", total=trials, quiet=quiet) as advance:
            config = config.changed(search(config, trials, out / "search", advance))
    with progress(f"train {task}", total=config.learning.steps, quiet=quiet) as advance:
        run = Run(config, out)
        run.learn(advance, snapshots)
    found = scores(config, out)
    if as_json:
        print_json({name: score._asdict() for name, score in found.items()})
        return
    rows = [[name, score.jnd, score.mean, f"{score.unstable} of {score.cases}"] for name, score in found.items()]
    print_table(["controller", "JND", "mean JND", "unstable"], rows, title=f"{task}, the benchmark's training split")
    click.echo(f"Policy: {out / 'policy.json'}")
