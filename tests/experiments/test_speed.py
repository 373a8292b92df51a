"""The table of speeds: what is counted and what is divided by what, without timing anything."""

import contextlib
import shutil

import numpy as np
import pytest

import controllers
from experiments import speed, speed_limit
from experiments.rollout import run, scored
from steer_env.envs.blocks import Score
from steer_env.envs.layout import Truth
from steer_env.envs.task import Task
from steer_env.physics.lanes import WIDTH
from steer_env.plants import PLANTS, Reference


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
    optional = {"gym-electric-motor, make", "limit: C, periods in lanes"}
    assert {name for pair in speed.compared({*names, *optional}) for name in pair} == {*names, *optional}
    assert len(speed.compared({*names, *optional})) == 2 + 2 * 2 + 4
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


def test_scores_of_many_episodes_are_those_of_single_ones():
    """Catches lanes that score another episode, lose noise at the border of two draws or go on after the end."""
    task, law = Task(randomise="all", duration=0.7), controllers.make("pid", PLANTS["EPAS"], Reference(), "impedance")
    seeds = range(3, 3 + WIDTH + 1)
    scores = scored(task, law, seeds)
    for k in (0, 13, WIDTH - 1, WIDTH):
        episode = run(task, law, seeds[k])
        score = Score(*scores[k])
        assert score.periods == len(episode.signals) > 1000
        reward = sum(episode[name].sum() for name in Truth._fields if name.startswith("reward"))
        assert score.reward == pytest.approx(reward, rel=1e-12)
        assert score.squared_error == pytest.approx(episode["error"] @ episode["error"], rel=1e-12)
        assert score.thrown == 0.0


def test_memory_of_one_environment_is_a_few_kibibytes():
    """Catches Python objects and noise that pile up for each environment: the bound is 4 KiB."""
    assert 1.5 * 1024 < speed.memory_of_one(256) < 4.0 * 1024
