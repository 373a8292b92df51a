"""Seeds and trials: the same wherever they run, kept when something is interrupted."""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from controllers import policy_file
from experiments.cli import main
from experiments.learning.config import TrainConfig
from experiments.learning.scoring import Score
from experiments.train import seeds_in
from steer_env import atomic
from steer_env.errors import InputError
from tests.controllers.made_up_policy import made_up

pytest.importorskip("stable_baselines3", reason="extra [learn] is not installed")
from experiments.learning import fleet
from experiments.learning import run as running
from experiments.learning import search as searching
from experiments.learning.arrangement import Scales

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = Path(__file__).with_name("training_on_a_cluster.py")
CONFIG = TrainConfig().changed({"learning.steps": "400", "action.authority": "0.05"})


@pytest.mark.slow
def test_seeds_over_a_cluster_of_two_nodes():
    """Catches a run that depends on where it is done, and work that is lost with a node."""
    pytest.importorskip("ray", reason="Ray is not installed (extra: learn)")
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    quiet = {"RAY_DEDUP_LOGS": "0", "RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
    # On a busy machine Ray gives up starting after 30 s, and lets its workers wait for everyone else.
    patient = {"RAY_raylet_start_wait_time_s": "200", "RAY_gcs_server_request_timeout_seconds": "200",
               "RAY_worker_niceness": "0"}  # fmt: skip
    done = subprocess.run(
        [sys.executable, str(SCRIPT)], capture_output=True, text=True, timeout=600, cwd=ROOT,
        env={**os.environ, **quiet, **patient, "PYTHONPATH": path},
    )  # fmt: skip
    told = [line for line in done.stdout.splitlines() if line.startswith("TOLD ")]
    assert told, done.stdout[-2000:] + done.stderr[-2000:]
    found = json.loads(told[0].removeprefix("TOLD "))
    assert found["nodes"] == 2
    assert set(found["far"]) == {"pid", "policy, seed 0", "policy, seed 1"}
    assert found["same"], "the same weights on a node and here"
    assert found["far"]["policy, seed 1"] == found["here"]["policy"] == found["again"]
    assert {"policy.json", "policy.safetensors", "run.json", "tensorboard"} <= set(found["files"])
    assert found["found"] == [0, 1]
    assert found["marks"] == 3, "what the dead node was at ran again on the other"


def bowl(runs):
    """Scores that are least at an authority of 0.3 and a gamma of 0.9."""
    return {
        folder: Score(abs(config.action.authority - 0.3) + abs(config.learning.gamma - 0.9), 1.0, 0, 42)
        for folder, config in runs.items()
    }


def test_search_finds_the_best_trial_and_goes_on_where_it_was(tmp_path):
    """Catches a search that draws what it drew before, or other trials, after an interruption."""
    pytest.importorskip("optuna", reason="Optuna is not installed (extra: tune)")
    seen = {}

    def watched(runs):
        seen.update(runs)
        assert all(config.learning.steps == 100 for config in runs.values())
        return bowl(runs)

    best = searching.search(CONFIG, 10, tmp_path / "whole", watched)
    values = {folder.name: bowl({folder: config})[folder].jnd for folder, config in seen.items()}
    assert list(values) == [f"{k:03d}" for k in range(10)]
    assert seen[tmp_path / "whole" / "000"].action == CONFIG.action, "as it is, though beyond the usual range"
    assert len(set(values.values())) == 10
    assert values[min(values, key=values.get)] == bowl({tmp_path: CONFIG.changed(best)})[tmp_path].jnd
    rounds = []

    def interrupted(runs):
        rounds.append(list(runs))
        if len(rounds) == 2:
            raise KeyboardInterrupt
        return bowl(runs)

    with pytest.raises(KeyboardInterrupt):
        searching.search(CONFIG, 10, tmp_path / "halves", interrupted)
    assert searching.search(CONFIG, 10, tmp_path / "halves", interrupted) == best
    assert rounds[1] == rounds[2], "the round that was interrupted"
    assert searching.search(CONFIG, 10, tmp_path / "halves", pytest.fail) == best, "nothing is left to do"


def test_an_unstable_trial_is_not_the_best(tmp_path):
    pytest.importorskip("optuna", reason="Optuna is not installed (extra: tune)")

    def train(runs):
        return {folder: Score(0.1, 0.1, 1, 10) if k else Score(1.0, 1.0, 0, 10) for k, folder in enumerate(runs)}

    best = searching.search(CONFIG, 3, tmp_path, train)
    assert CONFIG.changed(best).action == CONFIG.action


def test_what_is_finished_is_kept(tmp_path, monkeypatch):
    """Catches a run that is done again, and one that is taken for another with other settings."""
    policy = made_up("SbW", "impedance", training={"config": CONFIG.plain()})
    policy_file.save(policy, tmp_path / "done")
    monkeypatch.setattr(fleet, "Run", pytest.fail)
    monkeypatch.setattr(fleet, "score_of", lambda folder, config: Score(0.5, 0.6, 0, 42))
    told = []
    found = fleet.trained({tmp_path / "done": CONFIG}, advance=lambda steps=1, note="": told.append(steps))
    assert found == {tmp_path / "done": Score(0.5, 0.6, 0, 42)}
    assert told == [400]
    with pytest.raises(InputError, match="other settings"):
        fleet.trained({tmp_path / "done": CONFIG.changed({"learning.gamma": "0.9"})})


def test_what_comes_from_another_machine_is_what_a_run_leaves_here(tmp_path, monkeypatch):
    """Catches a file that does not travel, and a policy that says it is finished before its weights are there."""
    small = {"learning.environments": "8", "learning.rollout": "16", "learning.batch": "64", "learning.steps": "256"}
    config = TrainConfig().changed(small)
    scales = Scales((0.3, 0.5, 2.0, 30.0, 2.0, 2.0, 100.0, None, 7.0, 1.0, 0.3, 5.0, 1.0, None, None, None, None), 0.3)
    monkeypatch.setattr(running, "measured", lambda config: scales)
    monkeypatch.setattr(running, "gated", lambda found, reference: found)
    monkeypatch.setattr(fleet, "score_of", lambda folder, config: Score(0.5, 0.6, 0, 42))
    order = []

    def alike(function, jobs, address):
        assert address == "far"
        for folder, arguments in jobs.items():
            yield folder, function(*arguments)

    def written(path, content):
        order.append(path.name)
        atomic.write_bytes(path, content)

    monkeypatch.setattr(fleet, "results_of", alike)
    monkeypatch.setattr(fleet, "atomic", SimpleNamespace(write_bytes=written))
    far, here = tmp_path / "far", tmp_path / "here"
    assert fleet.trained({far: config}, ray="far") == {far: Score(0.5, 0.6, 0, 42)}
    assert order[-1] == "policy.json"
    fleet.trained({here: config})
    left = [{path.relative_to(folder).as_posix().split(".")[0] for path in folder.rglob("*")} for folder in (far, here)]
    assert left[1] - left[0] == {"checkpoint"}
    assert (far / "policy.safetensors").read_bytes() == (here / "policy.safetensors").read_bytes()
    assert fleet.is_finished(far, config)


def test_seeds_and_address_are_checked(tmp_path):
    assert seeds_in("0, 2,11") == [0, 2, 11]
    for wrong in ("", "0,", "a", "0,0", "-1", "1.5"):
        with pytest.raises(InputError, match="whole numbers"):
            seeds_in(wrong)
    pytest.importorskip("ray", reason="Ray is not installed (extra: learn)")
    arguments = ["train", "SbW-Impedance", "--seeds", "0,1", "--ray", "127.0.0.1:1", "--out", str(tmp_path)]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 2, done.output
    assert "ray start --head" in done.stderr
