"""The table of speeds: what is counted and what is divided by what, without timing anything."""

import contextlib
import shutil
from typing import Any, NamedTuple

import numpy as np
import pytest

import controllers
from controllers.schedule import Schedule, felt_at, schedule_of, schedules_in
from experiments import speed, speed_limit
from experiments.rollout import run, scored
from experiments.scored_lanes import look_up_of
from steer_env.envs.lanes_rollout import Score
from steer_env.envs.layout import Truth
from steer_env.envs.task import Task
from steer_env.physics.lanes import WIDTH, part_replacer
from steer_env.plants import PLANTS, Reference

REWARDS = [name for name in Truth._fields if name.startswith("reward")]


def test_a_run_counts_environment_steps():
    """Catches a vector case that counts calls, and an episode end that stops the loop."""
    action = np.array([0.1], np.float32)
    assert speed.single("CartPole-v1", 1)(100) == 100
    assert speed.single(speed.OURS, action)(3) == 3
    env = speed.gymnasium.make_vec(speed.OURS, 4, vectorization_mode="vector_entry_point")
    assert speed.vector(env, 0.1)(3) == 12


def test_every_compared_case_is_measured(monkeypatch):
    """Catches a renamed case, whose row would vanish from the ratios without a word."""
    monkeypatch.setattr(speed, "SIZES", (1, 2))
    names = speed.cases().keys()
    optional = {"gym-electric-motor, make", *speed.LIMITS}
    assert {name for pair in speed.compared({*names, *optional}) for name in pair} == {*names, *optional}
    assert len(speed.compared({*names, *optional})) == 2 + 2 * 2 + 5
    rates = {name: [1.0, 2.0] for name in names}
    rates["ours, make"] = [3.0, 6.0]
    _, ratios = speed.tables(rates)
    cells = [next(iter(column.cells)) for column in ratios.columns]
    assert cells == ["ours, make", "CartPole-v1, make", "3", "3", "3"]


def test_the_busy_process_is_there_only_beside_the_second_measurement(monkeypatch):
    """Catches a ratio of two measurements alone, and a process that goes on after the program."""
    running = []

    def measured(repeats, found, clock):
        running.append(list(neighbours))
        return {name: [3.0 - 2.0 * bool(neighbours)] for name in found}

    neighbours, started = [], speed.busy_neighbour

    @contextlib.contextmanager
    def watched():
        with started() as process:
            assert process.poll() is None
            neighbours.append(process)
            yield process
            neighbours.clear()
        assert process.poll() is not None

    monkeypatch.setattr(speed, "measured", measured)
    monkeypatch.setattr(speed, "busy_neighbour", watched)
    assert speed.beside_neighbour(2, {"case": lambda n: n}) == {"case": [1 / 3, 1 / 3]}
    assert [len(processes) for processes in running] == [0, 1, 0, 1]


@pytest.mark.skipif(shutil.which("gcc") is None and shutil.which("cc") is None, reason="no C compiler")
def test_the_limit_in_c_is_the_same_plant():
    """Catches an equation that changed in one of the two: then their speeds would not be comparable."""
    run = speed_limit.compiled_c()
    assert run is not None
    # C may fuse products: rounding, which the loop carries along for four seconds.
    assert speed_limit.check(speed_limit.compiled_python(), run) < 1e-8


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("pid", {"randomise": "all"}),
        ("passivity:lead", {"randomise": "plant", "speed_kmh": (27.0, 33.0), "causality": "admittance"}),
        ("h_infinity", {"randomise": ("plant", "car")}),
    ],
)
def test_scores_of_many_episodes_are_those_of_single_ones(name, options):
    """Catches lanes that score another episode, lose noise at the border of two draws or go on after the end, laws that
    round otherwise as vector code, and a reference that stays at the speed where it was looked up."""
    task = Task(duration=0.7, **options)
    law = controllers.make(name, PLANTS["EPAS"], Reference(), task.causality)
    seeds = range(3, 3 + WIDTH + 1)
    scores = scored(task, law, seeds)
    for k in (0, 13, WIDTH - 1, WIDTH):
        episode = run(task, law, seeds[k])
        score = Score(*scores[k])
        assert score.periods == len(episode.signals) > 1000
        rewards = [sum(row) for row in zip(*(episode[name] for name in REWARDS), strict=True)]
        assert score.reward == sequential_sum(rewards)
        assert score.squared_error == sequential_sum(episode["error"] * episode["error"])
        assert score.thrown == 0.0


def sequential_sum(values):
    total = 0.0
    for value in values:
        total += value
    return total


def test_a_law_of_its_own_kind_is_left_alone():
    """Catches a parameter that only looks like the reference over speed and is taken from its law."""

    class Own(NamedTuple):
        schedule: Any
        felt: Schedule

    table = schedule_of(Reference())
    assert set(schedules_in(Own(np.zeros((3, 10)), table))) == {(1,)}
    found, speed_table = look_up_of((1.0, Own(table, table)))
    assert (found, speed_table) == (None, None)
    found, speed_table = look_up_of(Own(table, table))
    assert found.paths == ((1,),)
    assert speed_table is table
    replaced = part_replacer(found.paths)(Own(table, table), found.at(20.0, table))
    assert replaced.schedule is table
    assert replaced.felt == felt_at(20.0, table) == felt_at(5.0, replaced.felt)


def test_memory_of_one_environment_is_a_few_kibibytes():
    """Catches Python objects and noise that pile up for each environment: the bound is 4 KiB."""
    assert 1.5 * 1024 < speed.memory_of_one(256) < 4.0 * 1024
