"""The table of speeds: what is counted and what is divided by what, without timing anything."""

import numpy as np

from experiments import speed


def test_a_run_counts_environment_steps():
    """Catches a vector case that counts calls, and an episode end that stops the loop."""
    action = np.array([0.1], np.float32)
    assert speed.single("CartPole-v1", 1)(100) == 100
    assert speed.single(speed.OURS, action)(3) == 3
    env = speed.gymnasium.make_vec(speed.OURS, 4, vectorization_mode="vector_entry_point")
    assert speed.vector(env, 0.1)(3) == 12


def test_every_compared_case_is_measured(monkeypatch):
    """Catches a renamed case, which would end a minute of measuring in a KeyError."""
    monkeypatch.setattr(speed, "SIZES", (1, 2))
    names = speed.cases().keys()
    assert {name for pair in speed.compared() for name in pair} == set(names)
    rates = {name: [1.0, 2.0] for name in names}
    rates["ours, make"] = [3.0, 6.0]
    _, ratios = speed.tables(rates)
    cells = [next(iter(column.cells)) for column in ratios.columns]
    assert cells == ["ours, make", "CartPole-v1, make", "3", "3", "3"]


def test_memory_of_one_environment_is_a_few_kibibytes():
    """Catches Python objects and noise that pile up for each environment: the bound is 4.5 KiB."""
    assert 1.5 * 1024 < speed.memory_of_one(256) < 4.5 * 1024
