"""Hyper-parameters by Optuna: short runs, each scored on the benchmark's training split after its gate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from controllers import policy
from experiments.learning.config import TrainConfig
from experiments.learning.run import Run
from experiments.learning.scoring import training_score
from steer_env.plants import Reference

SHARE = 4  # a trial takes one part in so many of the run's steps
RANGES = {
    "learning.learning_rate": (3e-4, 3e-3),
    "learning.gamma": (0.8, 0.98),
    "action.authority": (0.1, 0.6),
    "action.bandwidth_Hz": (5.0, 30.0),
    "reward.smoothness": (0.05, 2.0),
}
NOT_LOGARITHMIC = ("learning.gamma",)


def search(
    config: TrainConfig, trials: int, folder: Path, advance: Callable[..., None] = lambda *_, **__: None
) -> dict[str, str]:
    """The settings of the best of ``trials`` short runs, the first being the configuration as it is.

    Finished trials are kept in ``folder``, an interrupted one goes on from its checkpoint.
    """
    import optuna
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    storage = optuna.storages.JournalStorage(JournalFileBackend(str(folder / "journal.log")))
    study = optuna.create_study(
        storage=storage,
        study_name=f"{config.plant} {config.causality} {config.seed}",
        sampler=optuna.samplers.TPESampler(seed=config.seed, n_startup_trials=max(trials // 3, 2)),
        load_if_exists=True,
    )
    short = replace(config, learning=replace(config.learning, steps=max(config.learning.steps // SHARE, 1)))
    reference = Reference.load(config.domain.references[0])

    def one(trial: Any) -> float:
        settings = {
            name: f"{trial.suggest_float(name, low, high, log=name not in NOT_LOGARITHMIC):.4g}"
            for name, (low, high) in RANGES.items()
        }
        trial.set_user_attr("settings", settings)
        name = "_".join(settings.values())
        Run(short.changed(settings), folder / name).learn()
        made = partial(policy.make, folder=folder / name)
        score = training_score(made, config.plant, config.causality, reference)
        advance(note=f"{score.jnd:.3f} JND")
        return score.jnd + 10.0 * score.unstable / score.cases

    done = len(study.get_trials(states=[optuna.trial.TrialState.COMPLETE]))
    advance(min(done, trials), note="kept")
    if not study.trials:
        parts = {part: getattr(config, part) for part in ("learning", "action", "reward")}
        study.enqueue_trial({name: getattr(parts[name.split(".")[0]], name.split(".")[1]) for name in RANGES})
    study.optimize(one, n_trials=max(trials - done, 0))
    best: dict[str, str] = study.best_trial.user_attrs["settings"]
    return best
