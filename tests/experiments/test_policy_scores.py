"""What is late or wrong: a limit cycle counts, noise and a slow drift do not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import controllers
from experiments import policy_scores
from experiments.policy_scores import swing_left
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.plants import PLANTS, Reference

REFERENCE, SBW = Reference.load("published"), PLANTS["SbW"]


class MadeUp(SimpleNamespace):
    """An episode of one signal."""

    def __getitem__(self, name):
        return getattr(self, name)


def test_the_swing_is_that_of_the_end_without_its_drift():
    """2 N m of a sine in the last second; a drift of 3 N m/s, what was before, and a throw-out are told apart."""
    t = 1e-3 * np.arange(5000)
    torque = 3.0 * t + np.where(t < 3.0, 20.0, 1.0) * np.sin(2.0 * np.pi * 50.0 * t)
    assert swing_left(MadeUp(stable=True, torsion_bar_torque=torque)) == pytest.approx(2.0, rel=0.02)
    assert np.isnan(swing_left(MadeUp(stable=False, torsion_bar_torque=torque)))


def test_a_loop_beyond_its_delay_margin_is_left_swinging():
    """lqg bears 3.2 ms of extra delay at 105 km/h with nobody at the wheel: one period late it rests, five it swings.

    Catches a measure that only knows a wheel that was thrown out: friction and limits hold this one.
    """
    left = []
    for late in (1, 5):
        hardware = replace(SBW, motor=SBW.motor._replace(dead_time=SBW.motor.dead_time + late), nominal=SBW)
        task = Task(hardware, "impedance", REFERENCE, False, None, "random_torque", 105.0, "hands_off", duration=2.0)
        controller = controllers.make("lqg", SBW, REFERENCE, "impedance")
        episode = run(task, controller, seed=1, settle=policy_scores.REST_S)
        assert episode.stable
        left.append(swing_left(episode))
    assert left[0] < policy_scores.LEFT_NM / 2.0
    assert left[1] > 5.0 * policy_scores.LEFT_NM


def test_the_table_counts_arms_and_speeds(monkeypatch):
    """One row per controller, one column per fault; catches a fault that does not reach the hardware."""
    monkeypatch.setattr(policy_scores, "DRIVERS", {"hands_off": policy_scores.DRIVERS["hands_off"]})
    monkeypatch.setattr(policy_scores, "LATE_MS", (0, 5))
    monkeypatch.setattr(policy_scores, "FAULTS", {"offset": (1.0, 0.3)})
    table = policy_scores.shaken(["lqg"], "SbW", "impedance")
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells[0] == "lqg"
    assert [cell.split()[0] for cell in cells[1:]] == ["0", "2", "0"]
    assert [column.header for column in table.columns][1:] == ["0 ms late", "5 ms late", "offset"]
