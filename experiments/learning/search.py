"""Hyper-parameters by Optuna: short runs, each scored on the benchmark's training split after its gate.

Trials are chosen ROUND at a time from what the rounds before came to, whether one machine runs them or many: the
same seed finds the same settings on a laptop and on a cluster.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from experiments.learning.config import TrainConfig
from experiments.learning.scoring import Score

SHARE = 4  # a trial takes one part in so many of the run's steps
ROUND = 4
RANGES = {
    "learning.learning_rate": (3e-4, 3e-3),
    "learning.gamma": (0.8, 0.98),
    "action.authority": (0.1, 0.6),
    "action.bandwidth_Hz": (5.0, 30.0),
    "reward.smoothness": (0.05, 2.0),
}
NOT_LOGARITHMIC = ("learning.gamma",)
UNSTABLE_JND = 10.0  # what an episode that turns unstable costs, as in the benchmark
Train = Callable[[Mapping[Path, TrainConfig]], Mapping[Path, Score]]


def short(config: TrainConfig) -> TrainConfig:
    """The configuration that a trial begins with."""
    return replace(config, learning=replace(config.learning, steps=max(config.learning.steps // SHARE, 1)))


def search(config: TrainConfig, trials: int, folder: Path, train: Train) -> dict[str, str]:
    """The settings of the best of ``trials`` short runs, the first being the configuration as it is.

    ``train`` does the runs (folder -> configuration) and gives their scores. Finished trials are kept in ``folder``;
    a search that was interrupted goes on with the round that it was in.
    """
    import optuna
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    storage = optuna.storages.JournalStorage(JournalFileBackend(str(folder / "journal.log")))
    name = f"{config.plant} {config.causality} {config.seed}"
    study = optuna.create_study(storage=storage, study_name=name, load_if_exists=True)
    ranges = _ranges(config)
    if not study.trials:
        study.enqueue_trial(_now(config))
    complete, running = optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.RUNNING
    while (done := len(study.get_trials(states=(complete,)))) < trials:
        # A sampler of its own for each round, so that one that goes on draws what it would have drawn.
        study.sampler = optuna.samplers.TPESampler(seed=1000 * config.seed + done, n_startup_trials=max(trials // 3, 2))
        begun = study.get_trials(states=(running,))
        numbers = [trial.number for trial in begun if "settings" in trial.user_attrs]
        end = min((done // ROUND + 1) * ROUND, trials)
        while done + len(numbers) < end:
            numbers.append(_chosen(study.ask(), ranges))
        settings = {k: study.trials[k].user_attrs["settings"] for k in numbers}
        runs = {folder / f"{k:03d}": short(config).changed(settings[k]) for k in numbers}
        for k, score in zip(numbers, train(runs).values(), strict=True):
            study.tell(k, score.jnd + UNSTABLE_JND * score.unstable / score.cases)
    best: dict[str, str] = study.best_trial.user_attrs["settings"]
    return best


def _chosen(trial: Any, ranges: dict[str, tuple[float, float]]) -> int:
    """The number of a trial whose settings are drawn and kept with it."""
    settings = {
        name: f"{trial.suggest_float(name, low, high, log=name not in NOT_LOGARITHMIC):.4g}"
        for name, (low, high) in ranges.items()
    }
    trial.set_user_attr("settings", settings)
    return int(trial.number)


def _now(config: TrainConfig) -> dict[str, float]:
    """What the configuration itself has in the place of what is searched."""
    parts = {"learning": config.learning, "action": config.action, "reward": config.reward}
    named = (name.split(".") for name in RANGES)
    return {f"{part}.{item}": float(getattr(parts[part], item)) for part, item in named}


def _ranges(config: TrainConfig) -> dict[str, tuple[float, float]]:
    """RANGES, widened to hold the configuration itself."""
    now = _now(config)
    return {name: (min(low, now[name]), max(high, now[name])) for name, (low, high) in RANGES.items()}
