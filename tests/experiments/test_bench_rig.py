"""The benchmark through the CAN path: the same case, the same score; a trip is unstable; wrong names end at once."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import controllers
from experiments import bench_rig
from experiments.bench_cases import SETTLE_S, Case, number_of, scored_result, task_of
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.bench_rig import rig_episode, rig_result
from experiments.cli import main
from experiments.rollout import run
from steer_env.plants import Reference

REFERENCE, PROTOCOL = Reference.load("published"), Protocol.load()
SEEDS = PROTOCOL.draw_seeds["test"]
STEP = Case("SbW", "impedance", "pid", 75.0, "step_steer", "relaxed", split="test")


@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_the_can_path_gives_the_simulated_score(causality):
    """On the drawn plant, without noise (its values differ). A tenth of a JND is 1.5 % of the reference.

    What is left is a wire of 0.13 ms and where stiction and the sensors' steps catch the wheel: ten steps of the angle,
    three of the torque. Catches the nominal plant on the bus, a lost period, and the drive's way down in the score.
    """
    case = replace(STEP, causality=causality)
    task = task_of(case, REFERENCE, SEEDS)
    quiet = task.plant.sensors._replace(torque_noise=0.0)
    task = replace(task, plant=replace(task.plant, sensors=quiet))
    controller = controllers.make("pid", task.plant.believed(), REFERENCE, causality)
    seed = (0, number_of(case.place))
    simulated = run(task, controller, seed, SETTLE_S)
    real, ended, limited = rig_episode(task, controller, "simulated", seed)
    assert (ended, limited) == ("end of the manoeuvre", 0.0)
    assert real.signals.shape == simulated.signals.shape
    assert np.ptp(simulated["pinion_angle"]) > 1000 * quiet.angle_step
    assert np.abs(real["pinion_angle"] - simulated["pinion_angle"]).max() < 10.5 * quiet.angle_step
    assert np.abs(real["torsion_bar_torque"] - simulated["torsion_bar_torque"]).max() < 3.0 * quiet.torque_step
    scores = [case_score(scored_result(case, episode), PROTOCOL) for episode in (real, simulated)]
    assert abs(scores[0] - scores[1]) < 0.1


class Thrower:
    """Pushes as hard as it may, one way: no controller of a wheel."""

    def reset(self, period):
        pass

    def __call__(self, observation):
        return 7.5


def test_a_trip_is_an_unstable_episode_that_keeps_its_reason(monkeypatch):
    """Catches a tripped episode that is scored by the part before it."""
    monkeypatch.setattr(bench_rig, "WIDEST", bench_rig.WIDEST._replace(speed_limit=0.5))
    result = rig_result(STEP, REFERENCE, "simulated", 0, Thrower())
    assert not result["stable"]
    assert result["rig"]["ended"].startswith("tripped: ")
    assert case_score(result, PROTOCOL) == PROTOCOL.worst_score_jnd


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--env", "rig", "--motor", "sensowheel"], "sensowheel"),
        (["--motor", "moteus"], "--env rig"),
        (["--env", "rig", "--ray", "auto"], "--ray"),
    ],
)
def test_what_does_not_go_together_ends_at_once(tmp_path, arguments, word):
    done = CliRunner().invoke(main, ["benchmark", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2, done.output
    assert word in done.stderr
    assert not (tmp_path / "out").exists()
