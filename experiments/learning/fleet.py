"""Several training runs, each in a folder of its own: one after the other, in processes, or on a Ray cluster.

A run follows from its configuration alone, so where it is done changes nothing. What is done stays done: a
folder with a policy of the same configuration is scored, not trained again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from controllers import policy, policy_file
from experiments.learning import checkpoint
from experiments.learning.config import TrainConfig
from experiments.learning.run import Run
from experiments.learning.scoring import Score, training_score
from experiments.ray_cluster import results_of
from steer_env import atomic
from steer_env.errors import InputError
from steer_env.plants import Reference

Files = dict[str, bytes]
Advance = Callable[..., None]


def trained(
    runs: Mapping[Path, TrainConfig],
    jobs: int = 1,
    ray: str | None = None,
    advance: Advance = lambda *_, **__: None,
    snapshot_s: float = 0.0,
) -> dict[Path, Score]:
    """Scores on the training split of what the runs come to, whose folders are left as ``Run`` leaves them.

    ``advance`` counts steps of policies. ``ray`` is the address of a cluster ("auto": the one that runs here): there, a
    run whose node dies begins anew elsewhere, while here it goes on from its checkpoint.
    """
    found: dict[Path, Score] = {}
    waiting: dict[Path, TrainConfig] = {}
    for folder, config in runs.items():
        if is_finished(folder, config):
            found[folder] = score_of(folder, config)
            advance(config.learning.steps, note=f"{folder.name} kept")
        else:
            waiting[folder] = config
    if ray is not None:
        away = {folder: (config, snapshot_s) for folder, config in waiting.items()}
        for folder, (files, score) in results_of(trained_away, away, ray) if away else ():
            _write(files, folder)
            found[folder] = score
            advance(waiting[folder].learning.steps, note=f"{folder.name}: {score.jnd:.3f} JND")
    elif min(jobs, len(waiting)) > 1:
        for folder, score in _in_processes(waiting, min(jobs, len(waiting)), snapshot_s):
            found[folder] = score
            advance(waiting[folder].learning.steps, note=f"{folder.name}: {score.jnd:.3f} JND")
    else:
        for folder, config in waiting.items():
            Run(config, folder).learn(advance, snapshot_s)
            found[folder] = score_of(folder, config)
    return {folder: found[folder] for folder in runs}


def is_finished(folder: Path, config: TrainConfig) -> bool:
    """Whether the policy of this configuration lies in the folder; InputError where another's does."""
    path = folder / policy_file.DESCRIPTION
    if not path.exists():
        return False
    if policy_file.load(folder).training.get("config") != config.plain():
        what = "another run, with other settings, is in this folder"
        raise InputError(str(folder), what, "give another --out, or the same settings to go on")
    return True


def score_of(folder: Path, config: TrainConfig) -> Score:
    """Training-split score of the policy in a folder."""
    reference = Reference.load(config.domain.references[0])
    return training_score(partial(policy.make, folder=folder), config.plant, config.causality, reference)


def trained_here(folder: Path, config: TrainConfig, snapshot_s: float) -> Score:
    """One run, in a process of its own."""
    Run(config, folder).learn(snapshot_s=snapshot_s)
    return score_of(folder, config)


def trained_away(config: TrainConfig, snapshot_s: float) -> tuple[Files, Score]:
    """One run on another machine: what it leaves in its folder, but the checkpoint, and its score."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        score = trained_here(folder, config, snapshot_s)
        left = [path for path in folder.rglob("*") if path.is_file() and path.name != checkpoint.NAME]
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in left}, score


def _in_processes(waiting: Mapping[Path, TrainConfig], jobs: int, snapshot_s: float) -> Iterator[tuple[Path, Score]]:
    # Spawned, not forked: threads of numba and torch do not survive a fork.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"))
    try:
        runs = {pool.submit(trained_here, folder, config, snapshot_s): folder for folder, config in waiting.items()}
        for done in as_completed(runs):
            yield runs[done], done.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _write(files: Files, folder: Path) -> None:
    """The files of a run, its policy's description last: that is what says that it is finished."""
    for name in sorted(files, key=lambda name: name == policy_file.DESCRIPTION):
        atomic.write_bytes(folder / name, files[name])
