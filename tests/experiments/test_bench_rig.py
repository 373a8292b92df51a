"""The benchmark through the CAN path: the same case, the same score; a trip is unstable; wrong names end at once."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.stats import trim_mean

import controllers
from experiments import bench_rig
from experiments.bench_cases import SETTLE_S, Case, number_of, scored_result, task_of
from experiments.bench_noise import noise_interval
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


@pytest.mark.parametrize("noisy", [True, False])
def test_a_noise_seed_changes_the_noise_and_nothing_else(noisy):
    """Catches another size of the manoeuvre, which is drawn from the episode's seed; without noise: the same bits."""
    task = task_of(STEP, REFERENCE, SEEDS)
    if not noisy:
        sensors = task.plant.sensors._replace(torque_noise=0.0, angle_noise=0.0)
        task = replace(task, plant=replace(task.plant, sensors=sensors))
    controller = controllers.make("pid", task.plant.believed(), REFERENCE, "impedance")
    seed = (0, number_of(STEP.place))
    first, other, again = (run(task, controller, seed, SETTLE_S, noise) for noise in (None, (1, 2), (1, 2)))
    assert np.array_equal(first.setup.row, other.setup.row)
    assert np.array_equal(other.signals, again.signals)
    assert np.array_equal(first.signals, other.signals) == (not noisy)


def test_the_noise_interval_holds_one_more_draw_19_times_in_20():
    """Scores of ten draws, then an eleventh: counted over 2000 repeats, within 4 standard deviations of 95 %."""
    rng, inside = np.random.default_rng(0), 0
    size = rng.uniform(0.1, 2.0, (12, 1))
    for _ in range(2000):
        scores = size * (1.0 + 0.05 * rng.standard_normal((12, 11)))
        low, high = noise_interval(scores[:, :10])
        inside += low <= trim_mean(scores[:, 10], 0.25) <= high
    assert abs(inside / 2000 - 0.95) < 4.0 * np.sqrt(0.95 * 0.05 / 2000)


def test_scores_stand_beside_what_noise_alone_does():
    """Two cases of one controller: interquartile means, the interval of ten draws, the widest that one case moves."""
    metric = PROTOCOL.score["step_steer"][0]

    def result(score, noise=()):
        case = {"controller": "pid", "causality": "impedance", "manoeuvre": "step_steer"}
        rig = {"ended": "end of the manoeuvre", "limited": 0.0, "noise": list(noise)}
        return {"case": case, "stable": True, "scores": {metric: score}, "rig": rig}

    noise = [0.1 + 0.01 * k for k in range(9)], [0.5 - 0.02 * k for k in range(9)]
    here, there = [result(0.2, noise[0]), result(0.6, noise[1])], [result(0.1), result(0.5)]
    (row,) = bench_rig.beside(here, there, PROTOCOL)
    assert (row.score, row.simulated_score) == pytest.approx((0.4, 0.3))
    assert row.by_noise == noise_interval([[0.1, *noise[0]], [0.5, *noise[1]]])
    assert row.largest_by_noise == pytest.approx(0.16)
    assert row.largest_difference == pytest.approx(0.1)


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
