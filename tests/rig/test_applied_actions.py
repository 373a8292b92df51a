"""The wrapper adds exactly what was applied, in order, after what the observation holds already."""

import gymnasium
import numpy as np
import pytest

import steer_env  # noqa: F401  (registers the ids)
from steer_env.errors import InputError
from steer_env.rig.applied_actions import HELD, AppliedActions


def make(count):
    return AppliedActions(gymnasium.make("steer_env/SbW-Impedance-v0", duration=1.0), count)


def test_the_past_is_what_was_applied_newest_first():
    """Commands of 0.01, 0.02, ... of the rated torque, within the slew limit: step k shows k, k-1, ... ."""
    env = make(7)
    observation, _ = env.reset(seed=0)
    assert np.array_equal(observation[-7:], np.zeros(7))
    for k in range(1, 12):
        observation, *_ = env.step(np.array([0.01 * k], np.float32))
        expected = [0.01 * max(k - back, 0) for back in range(7)]
        assert observation[-7:] == pytest.approx(expected, abs=1e-6)
        assert observation in env.observation_space
    env.reset(seed=0)
    assert np.array_equal(env.step(np.array([0.0], np.float32))[0][-7:], np.zeros(7))


def test_it_tells_what_was_applied_and_not_what_was_asked():
    """A full step beyond the slew limit of 3000 N m/s: 3 N m of 7.5 in the first period."""
    env = make(HELD + 1)
    env.reset(seed=0)
    env.step(np.array([1.0], np.float32))
    for _ in range(HELD):
        observation, *_ = env.step(np.array([0.0], np.float32))
    assert observation[-1] == pytest.approx(3.0 / 7.5)


def test_four_change_nothing_and_fewer_or_too_many_are_refused():
    env = make(HELD)
    assert env.observation_space == env.unwrapped.observation_space
    for count in (HELD - 1, 65):
        with pytest.raises(InputError, match="count"):
            make(count)
