"""Time to quality of learned policies: python -m experiments.policy_study OUT [--task SbW-Impedance] [--seeds 3].

Every seed of every task is trained as ``steer-env train`` would (the same command goes on where it
was), the policy being kept every few seconds of training. Each kept policy is scored afterwards on the
benchmark's training split, beside every classical law: after how long is a policy better than tuned pid,
and than the best classical law? Scoring takes no training time. Times are seconds of the processor, one
thread, so that they do not tell what else the machine did; the wall time is told beside them.
``--vary STEPS`` trains variants instead, and scores what they come to. All seeds are told; what is done is kept
in OUT, so that a study may be run in pieces (one task, one variant, fewer seeds first).
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import click
import matplotlib.pyplot as plt
from rich.console import Console
from rich.table import Table

import controllers
from controllers import policy
from experiments.learning.config import TrainConfig
from experiments.learning.scoring import Score, classical_scores, training_score
from experiments.train import config_of
from steer_env import atomic
from steer_env.plants import Reference

TASKS = ("SbW-Impedance", "EPAS-Admittance")
RIVAL = "pid"
SNAPSHOT_S = 2.5
MOST_SNAPSHOTS = 8  # scored of a run, evenly over its time
FULL = {"action.base": "none", "action.authority": "3"}
LATE = {"domain.extra_dead_time": "4"}
VARIANTS: dict[str, dict[str, str]] = {
    "as it ships": {},
    "one plant, car and arm": {"domain.randomise": "false"},
    "four past actions": {"action.history": "4"},
    "late commands": LATE,
    "late commands, four past actions": {**LATE, "action.history": "4"},
    "full torque": FULL,
    "full torque, pid imitated first": {**FULL, "action.bandwidth_Hz": "40", "learning.imitate": "pid"},
}


def trained(config: TrainConfig, folder: Path, snapshot_s: float = 0.0) -> dict[str, Any]:
    """run.json of a run in a folder, trained if it is not there yet."""
    from experiments.learning.run import Run  # needs torch; scoring alone does not

    told = folder / "run.json"
    if not told.exists():
        Run(config, folder).learn(snapshot_s=snapshot_s)
    content: dict[str, Any] = json.loads(told.read_text("utf-8"))
    return content


def curve(config: TrainConfig, folder: Path, reference: Reference) -> dict[str, Any]:
    """Scores of the kept policies over time in s, and of the final one; kept in curve.json."""
    path = folder / "curve.json"
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text("utf-8"))
        return kept
    told = trained(config, folder, SNAPSHOT_S)
    snapshots = told["snapshots"]
    every = max(-(-len(snapshots) // MOST_SNAPSHOTS), 1)
    points = []
    for snapshot in snapshots[::every]:
        score = _score(config, folder / "snapshots" / snapshot["name"], reference)
        points.append({**snapshot, **score._asdict()})
    final = _score(config, folder, reference)
    last = {"name": "final", "wall_s": told["wall_s"], "cpu_s": told["cpu_s"], "steps": config.learning.steps}
    found = {"points": points, "final": {**last, **final._asdict()}}
    atomic.write_text(path, json.dumps(found, indent=1) + "\n")
    return found


def seconds_until(points: list[dict[str, Any]], jnd: float) -> float | None:
    """Time of the first point from which on the score stays below a value; None where it never does."""
    since = None
    for point in points:
        if point["jnd"] >= jnd:
            since = None
        elif since is None:
            since = point["cpu_s"]
    return since


def _score(config: TrainConfig, folder: Path, reference: Reference) -> Score:
    return training_score(partial(policy.make, folder=folder), config.plant, config.causality, reference)


def studied(out: Path, task: str, seeds: int, settings: dict[str, str]) -> dict[str, Any]:
    """Curves of all seeds of one task, with the classical laws' scores."""
    reference = Reference.load("published")
    curves = []
    for seed in range(seeds):
        config = config_of(task, seed, settings)
        curves.append(curve(config, out / f"{task}_{config.action.base}_{seed}", reference))
    rivals = classical_scores(tuple(controllers.CONTROLLERS), config.plant, config.causality, reference)
    steady = {name: score for name, score in rivals.items() if not score.unstable}
    best = min(steady, key=lambda name: steady[name].jnd)
    return {"task": task, "curves": curves, "classical": {k: v._asdict() for k, v in rivals.items()}, "best": best}


def table_of(studies: list[dict[str, Any]]) -> Table:
    """Seconds until pid and the best classical law are beaten, seed by seed."""
    table = Table("task", "seed", "final JND", "pid", "best classical", "s until pid", "s until best", "s in all",
                  "wall s")  # fmt: skip
    for study in studies:
        rival, best = study["classical"][RIVAL]["jnd"], study["classical"][study["best"]]["jnd"]
        for seed, found in enumerate(study["curves"]):
            times = [seconds_until(found["points"], value) for value in (rival, best)]
            cells = ["never" if t is None else f"{t:.0f}" for t in times]
            final = found["final"]
            table.add_row(
                study["task"], str(seed), f"{final['jnd']:.3f}", f"{rival:.3f}", f"{best:.3f} {study['best']}",
                *cells, f"{final['cpu_s']:.0f}", f"{final['wall_s']:.0f}",
            )  # fmt: skip
    return table


def draw(studies: list[dict[str, Any]], path: Path) -> None:
    """Curves of all seeds over wall time beside the classical laws."""
    figure, axes = plt.subplots(1, len(studies), figsize=(5.5 * len(studies), 4.0), squeeze=False)
    for axis, study in zip(axes[0], studies, strict=True):
        for seed, found in enumerate(study["curves"]):
            times = [point["cpu_s"] for point in found["points"]]
            line = axis.plot(times, [point["jnd"] for point in found["points"]], label=f"seed {seed}")[0]
            axis.plot(found["final"]["cpu_s"], found["final"]["jnd"], "o", color=line.get_color())
        for name, style in ((RIVAL, "--"), (study["best"], ":")):
            axis.axhline(study["classical"][name]["jnd"], color="#333333", linestyle=style, label=name)
        axis.set(title=study["task"], xlabel="training, CPU time of one thread / s", ylabel="JND, training split")
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def final(config: TrainConfig, folder: Path, reference: Reference) -> dict[str, Any]:
    """What a variant comes to: score, least share of its authority, tracking in its own domain; kept in final.json."""
    path = folder / "final.json"
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text("utf-8"))
        return kept
    log = trained(config, folder)["log"]
    last = [-entry["tracking"] for entry in log[-max(len(log) // 4, 1) :]]
    shares = [share for _, share in json.loads((folder / "policy.json").read_text("utf-8"))["shares"]]
    score = _score(config, folder, reference)
    found = {**score._asdict(), "share": min(shares), "own_domain": sum(last) / len(last)}
    atomic.write_text(path, json.dumps(found, indent=1) + "\n")
    return found


def varied(out: Path, task: str, steps: int, seeds: int, names: tuple[str, ...], settings: dict[str, str]) -> Table:
    """Scores of the variants seed by seed; "own domain" is the tracking in the last quarter of training, in JND."""
    reference = Reference.load("published")
    headings = ("variant", "JND, seed by seed", "mean JND", "own domain", "unstable", "least share of authority")
    table = Table(*headings, title=f"{task}, {steps} steps")
    for name in names:
        found = []
        for seed in range(seeds):
            config = config_of(task, seed, {"learning.steps": str(steps), **settings, **VARIANTS[name]})
            folder = out / f"{task}_{name.replace(' ', '_').replace(',', '')}_{seed}"
            found.append(final(config, folder, reference))
        told = [", ".join(f"{one[key]:.3f}" for one in found) for key in ("jnd", "mean", "own_domain")]
        unstable = f"{sum(one['unstable'] for one in found)} of {sum(one['cases'] for one in found)}"
        table.add_row(name, *told, unstable, ", ".join(f"{one['share']:.2f}" for one in found))
    return table


@click.command()
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--task", "tasks", multiple=True, default=TASKS, show_default=True, help="May be given again.")
@click.option("--seeds", default=3, show_default=True, type=click.IntRange(1))
@click.option("--vary", default=0, metavar="STEPS", help="Train the variants with so many steps instead.")
@click.option("--variant", "names", multiple=True, type=click.Choice(list(VARIANTS)), help="Those alone.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="As of steer-env train.")
def main(
    out: Path, tasks: tuple[str, ...], seeds: int, vary: int, names: tuple[str, ...], settings: tuple[str, ...]
) -> None:
    """Train, score and print; curves go to OUT/time_to_quality.png."""
    console = Console(width=130)
    changes = dict(text.split("=", 1) for text in settings)
    if vary:
        for task in tasks:
            console.print(varied(out, task, vary, seeds, names or tuple(VARIANTS), changes))
        return
    studies = [studied(out, task, seeds, changes) for task in tasks]
    console.print(table_of(studies))
    for study in studies:
        finals = [found["final"]["jnd"] for found in study["curves"]]
        spread = f"{min(finals):.3f} to {max(finals):.3f}"
        console.print(f"{study['task']}: median of seeds {median(finals):.3f} JND, {spread}")
    atomic.write_text(out / "time_to_quality.json", json.dumps(studies, indent=1) + "\n")
    draw(studies, out / "time_to_quality.png")


if __name__ == "__main__":
    main()
