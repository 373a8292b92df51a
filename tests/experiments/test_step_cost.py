"""The cost of a control step: what is counted and how times become figures, without judging any time."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import controllers
from experiments import step_cost, step_times
from steer_env.envs.task import Task
from steer_env.interface import Observation
from steer_env.plants import PLANTS, Reference


def test_a_steps_own_time_is_the_least_of_its_passes():
    """Closed form: a pass that was interrupted in one step must not move the figures, and must show as it came."""
    times = np.full((3, 2000), 1000.0)
    times[0, 700:800], times[1, 3] = 9e6, 5e6
    cost = step_cost.summary("pid", "impedance", 400.0, times, 20.0 * times)
    assert (cost.steps, cost.mean_us, cost.p50_us, cost.p999_us) == (2000, 0.4, 1.0, 1.0)
    assert (cost.python_p50_us, cost.python_p999_us) == (20.0, 20.0)
    assert cost.p999_as_it_came_us == 9000.0
    assert cost.python_p999_as_it_came_us == 180_000.0


def test_the_observations_are_those_of_the_loop_itself():
    """Catches a controller timed on rows that it would never see: its commands must be in them one period later."""
    controller = controllers.make("pid", PLANTS["EPAS"], Reference.load("published"), "impedance")
    rows = step_times.recorded(Task(driver="tense"), controller, 1200)
    times, torques, limited = step_times.python_pass(controller, rows)
    np.testing.assert_array_equal(rows[1:, Observation._fields.index("last_torque_1")], torques[:-1])
    assert np.abs(torques).max() > 0.05
    assert (times > 0.0).all()
    assert not limited.any()


def test_every_controller_is_in_the_table_and_mpc_with_a_limit_acting(monkeypatch):
    """Catches a row lost, and an episode in which no limit acts; compiled and Python torques are compared inside."""
    monkeypatch.setattr(step_cost, "PASSES", 1)
    costs = step_cost.costs(PLANTS["EPAS"], 4000, ("open_loop_map",))
    rows = [(cost.controller, cost.causality) for cost in costs]
    both = [(name, each) for each in controllers.CAUSALITIES for name in ("open_loop_map", step_cost.LIMITED)]
    assert rows == [("nothing", ""), *both]
    limited = [cost for cost in costs if cost.controller == step_cost.LIMITED]
    assert all(50 < cost.steps < 4000 for cost in limited)
    assert all(0.0 < cost.p50_us <= cost.p999_us for cost in costs)

    monkeypatch.setattr(step_cost, "costs", lambda plant, steps: costs)
    shown = json.loads(CliRunner().invoke(step_cost.main, ["--json"]).output)
    assert shown["period_us"] == pytest.approx(1000.0)
    assert [row["controller"] for row in shown["costs"]] == [cost.controller for cost in costs]
    assert step_cost.LIMITED in CliRunner().invoke(step_cost.main, []).output


def test_the_benchmark_gets_every_law_that_runs_compiled(monkeypatch):
    """Catches a user's controller without a pure law that ends the run, and a law timed on another's observations."""
    monkeypatch.setattr(step_cost, "REPORTED_STEPS", 300)
    mine = {"mine": lambda *told: controllers.make("pid", *told), "stepwise": lambda *_: object()}
    found = step_cost.reported(["open_loop_map", "mine", "stepwise"], Reference.load("published"), mine)
    assert list(found) == ["open_loop_map", "mine"]
    assert all(0.0 < cost["p50_us"] <= cost["p999_us"] for cost in found.values())
