"""Tune a controller's gains on the training cases of the benchmark: steer-env tune.

The objective is the benchmark's own (interquartile mean of case scores in JND), by half with the
plain mean, which the worst cases enter too, plus what a score leaves out: an unstable episode costs
its share of the worst score, so does a place that turns unstable when commands come one period later,
and a loop that the linear proof calls unsafe costs a worst score more. Plants, cars and arms come
from the training seeds, which the scored cases never touch. The first trial is the law's design
formula as it is, the second the gains that are shipped, so tuning cannot make either worse on this
ground. The result is a data file as controllers/tuned ships them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import click
import numpy as np
from scipy.stats import trim_mean

import controllers
from controllers import tuning
from controllers.law import Factor
from experiments import bench_cases
from experiments.bench_cases import Case, Maker
from experiments.bench_gates import unstable_share
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.metrics import METRICS
from steer_env import __version__, atomic
from steer_env.errors import InputError
from steer_env.interface import Controller
from steer_env.plants import PLANTS, Plant, Reference

SPEEDS_KMH = (30.0, 45.0, 75.0, 105.0)  # between them lie the speeds that the score adds
DRAWS = 1  # plants per speed and manoeuvre: 24 cases, each with a plant, car and arm of its own
OBJECTIVE = (
    "half the interquartile mean and half the mean of case scores in JND + worst score x (share of episodes unstable "
    "+ share of places unstable one period later + 1 and share of places unstable in the linear proof, if any)"
)
Factors = dict[str, float]


def tunable(name: str) -> dict[str, tuple[float, float]]:
    """What may be tuned in a controller of the table: gain -> range of factors on the design's value."""
    if name not in controllers.CONTROLLERS:
        known = ", ".join(controllers.CONTROLLERS)
        raise InputError("CONTROLLER", f"{name!r} is not known", f"use one of {known}")
    found: dict[str, tuple[float, float]] = import_module(controllers.CONTROLLERS[name]).TUNABLE
    return found


def maker_with(name: str, factors: Factors) -> Maker:
    """A make() of a controller with factors on its gains instead of the shipped ones."""

    def make(plant: Plant, reference: Reference, causality: str) -> Controller:
        gains = {gain: Factor(share) for gain, share in factors.items()}
        return controllers.make(name, plant, reference, causality, tuned=False, **gains)

    return make


def objective(name: str, plant: str, causality: str, factors: Factors, reference: Reference, seed: int) -> float:
    """What tuning makes small, in JND."""
    protocol, make = Protocol.load(), maker_with(name, factors)
    try:
        make(PLANTS[plant], reference, causality)
    except InputError:
        return 3.0 * protocol.worst_score_jnd  # a factor that leaves a gain's valid range
    cases = protocol.training_cases(name, plant, causality, SPEEDS_KMH, DRAWS)
    scores, unstable = [], 0
    for case in cases:
        result = scored(case, reference, seed, make, protocol)
        scores.append(case_score(result, protocol))
        unstable += not result["stable"]
    proof = unstable_share(make, plant, causality, reference, protocol.speeds_kmh)
    late = unstable_share(make, plant, causality, reference, SPEEDS_KMH, late=1)
    share = unstable / len(cases) + late + (1.0 + proof if proof > 0.0 else 0.0)
    return 0.5 * float(trim_mean(scores, 0.25) + np.mean(scores)) + protocol.worst_score_jnd * share


def scored(case: Case, reference: Reference, seed: int, make: Maker, protocol: Protocol) -> dict[str, Any]:
    """The part of a result that the score looks at."""
    episode = bench_cases.episode_of(case, reference, seed, protocol.draw_seeds["training"], make)
    scores: dict[str, float | None] = {}
    if episode.stable:
        trial = bench_cases.trial_of(case, episode)
        for metric in protocol.score[case.manoeuvre]:
            value = METRICS[metric].measure(trial)
            scores[metric] = value if np.isfinite(value) else None
    return {"case": {"manoeuvre": case.manoeuvre}, "stable": episode.stable, "scores": scores}


def tune_loop(
    name: str,
    plant: str,
    causality: str,
    reference: Reference,
    trials: int,
    seed: int,
    journal: Path | None = None,
    advance: Callable[..., None] = lambda *_, **__: None,
) -> dict[str, Any]:
    """Factors, scores before and after and the number of trials for one plant and causality.

    ``journal`` keeps finished trials, so that an interrupted run goes on.
    """
    import optuna
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    ranges = tunable(name)
    storage: Any = None
    if journal is not None:
        journal.parent.mkdir(parents=True, exist_ok=True)
        storage = optuna.storages.JournalStorage(JournalFileBackend(str(journal)))
    study = optuna.create_study(
        storage=storage,
        study_name=f"{name} {plant} {causality} {trials} {seed}",
        sampler=optuna.samplers.TPESampler(seed=seed, n_startup_trials=max(min(15, trials // 4), 1)),
        load_if_exists=True,
    )

    def one(trial: Any) -> float:
        drawn = {gain: trial.suggest_float(gain, low, high, log=True) for gain, (low, high) in ranges.items()}
        value = objective(name, plant, causality, rounded(drawn), reference, seed)
        advance(note=f"{plant} {causality}: {value:.2f} JND")
        return value

    done = len(study.get_trials(states=[optuna.trial.TrialState.COMPLETE]))
    advance(min(done, trials), note="kept")
    if not done:
        study.enqueue_trial(dict.fromkeys(ranges, 1.0))
        study.enqueue_trial(shipped_factors(name, plant, causality, ranges))
    study.optimize(one, n_trials=max(trials - done, 0))
    first = study.trials[0].value
    best = rounded(study.best_params)
    return {
        "factors": without_idle(best, lambda factors: objective(name, plant, causality, factors, reference, seed)),
        "objective_before": first,
        "objective_after": study.best_value,
        "trials": len(study.trials),
    }


def shipped_factors(name: str, plant: str, causality: str, ranges: dict[str, tuple[float, float]]) -> Factors:
    """The factors that controllers/tuned has, inside the ranges; 1 where it has none."""
    shipped = tuning.gains_for(name, plant, causality)
    found = {}
    for gain, (low, high) in ranges.items():
        factor = shipped.get(gain, Factor(1.0))
        found[gain] = min(max(factor.share if isinstance(factor, Factor) else 1.0, low), high)
    return found


def rounded(factors: Factors) -> Factors:
    """Factors as the file holds them; what is tried is what is stored, to the last bit."""
    return {gain: float(f"{share:.4g}") for gain, share in factors.items()}


def without_idle(factors: Factors, cost: Callable[[Factors], float]) -> Factors:
    """The factors less those that change nothing, such as gains of the other causality's law."""
    reached, kept = cost(factors), dict(factors)
    for gain in factors:
        fewer = {name: share for name, share in kept.items() if name != gain}
        if cost(fewer) == reached:
            kept = fewer
    return kept


def tune(
    name: str,
    reference: Reference,
    systems: Sequence[tuple[str, str]],
    trials: int,
    seed: int,
    jobs: int,
    journals: Path | None = None,
    advance: Callable[..., None] = lambda *_, **__: None,
) -> dict[str, Any]:
    """The content of a file of gains for some plants and causalities."""

    def one(system: tuple[str, str]) -> dict[str, Any]:
        journal = None if journals is None else journals / f"{name}_{'_'.join(system)}.log"
        return tune_loop(name, *system, reference, trials, seed, journal, advance)

    with ThreadPoolExecutor(jobs) as pool:
        loops = list(pool.map(one, systems))
    protocol = Protocol.load()
    return {
        "schema_version": tuning.SCHEMA_VERSION,
        "controller": name,
        "objective": OBJECTIVE,
        "protocol": protocol.name,
        "training": {
            "speeds_kmh": list(SPEEDS_KMH),
            "draws": DRAWS,
            "draw_seeds": protocol.draw_seeds["training"],
            "reference": reference.source,
        },
        "seed": seed,
        "software_version": __version__,
        "loops": {tuning.loop_name(*system): loop for system, loop in zip(systems, loops, strict=True)},
    }


@click.command()
@click.argument("controller")
@click.option("--reference", "source", default="published", show_default=True, metavar="FILE", help="A reference.json.")
@click.option("--plant", type=click.Choice(list(PLANTS)), help="Only this plant.")
@click.option("--causality", type=click.Choice(controllers.CAUSALITIES), help="Only this causality.")
@click.option("--trials", type=click.IntRange(min=1), default=80, show_default=True, metavar="N", help="Per system.")
@common_options
def command(
    controller: str,
    source: str,
    plant: str | None,
    causality: str | None,
    trials: int,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Tune the gains of CONTROLLER on the benchmark's training cases.

    Writes CONTROLLER.json, a file of gains as controllers/tuned ships them: with --out
    controllers/tuned the new gains are the defaults. What the file already holds for other plants and
    causalities stays. An interrupted run goes on where it was.
    """
    tunable(controller)
    reference = Reference.load(source)
    systems = [
        (p, c) for p, c in product(PLANTS, controllers.CAUSALITIES) if plant in (None, p) and causality in (None, c)
    ]
    with progress(f"tune {controller}", total=trials * len(systems), quiet=quiet) as advance:
        journals = Path(f"{out}_trials") if out == tuning.FOLDER else out / "trials"
        found = tune(controller, reference, systems, trials, seed, jobs, journals, advance)
    path = out / f"{controller}.json"
    if path.exists():
        kept = json.loads(path.read_text("utf-8"))["loops"]
        found["loops"] = dict(sorted({**kept, **found["loops"]}.items()))
    atomic.write_text(path, json.dumps(found, indent=1, allow_nan=False) + "\n")
    if as_json:
        print_json(found)
        return
    rows = [[loop, v["objective_before"], v["objective_after"], v["trials"]] for loop, v in found["loops"].items()]
    print_table(["system", "before [JND]", "after [JND]", "trials"], rows, title=f"{controller}: {path}")
