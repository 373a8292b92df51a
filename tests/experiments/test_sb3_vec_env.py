"""The stable-baselines3 VecEnv: what DummyVecEnv gives, episode statistics, a short training."""

import gymnasium
import numpy as np
import pytest

import steer_env  # noqa: F401  (registers the ids)

pytest.importorskip("stable_baselines3", reason="extra [learn] is not installed")

from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from experiments.sb3_vec_env import SteerVecEnv

ID = "steer_env/EPAS-Impedance-v0"
SHORT = {"randomise": "all", "manoeuvre": "step_steer", "duration": 0.05}
N = 3


def test_same_as_dummy_vec_env():
    """Catches a wrong last observation, a wrong truncation, statistics of the wrong episode."""
    ours = SteerVecEnv(ID, N, **SHORT)
    theirs = DummyVecEnv([lambda: Monitor(gymnasium.make(ID, **SHORT))] * N)
    ours.seed(4)
    theirs.seed(4)
    assert np.array_equal(ours.reset(), theirs.reset())
    rng, ends = np.random.default_rng(0), 0
    for _ in range(1200):
        actions = rng.uniform(-0.2, 0.2, (N, 1)).astype(np.float32)
        mine, single = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:3], single[:3], strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)
        for i in np.flatnonzero(mine[2]):
            ends += 1
            info, other = mine[3][i], single[3][i]
            assert np.array_equal(info["terminal_observation"], other["terminal_observation"])
            assert info["TimeLimit.truncated"] == other["TimeLimit.truncated"]
            assert info["ended"] == other["ended"]
            assert info["episode"]["r"] == pytest.approx(other["episode"]["r"], abs=1e-5)
            assert info["episode"]["l"] == other["episode"]["l"]
    assert ends >= 2 * N


def test_ppo_trains_on_it():
    """Catches shapes, dtypes and infos that a training loop warns about or cannot take."""
    env = SteerVecEnv(ID, 8, **SHORT)
    model = PPO("MlpPolicy", env, n_steps=75, batch_size=200, n_epochs=1, device="cpu", seed=0)
    model.learn(8 * 75 * 8)
    assert len(model.ep_info_buffer) >= 8
    assert {"r", "l", "t"} <= set(model.ep_info_buffer[0])
    mean, _ = evaluate_policy(model, SteerVecEnv(ID, 2, **SHORT), n_eval_episodes=2)
    assert np.isfinite(mean)


def test_options_and_refusals():
    """Catches options that are dropped and calls that would silently do nothing."""
    env = VecNormalize(SteerVecEnv(ID, 2))
    env.unwrapped.set_options({"speed_kmh": 30.0})
    env.reset()
    assert env.unwrapped.signals["speed"] == pytest.approx(np.full(2, 30.0 / 3.6))
    assert env.get_attr("num_envs") == [2, 2]
    with pytest.raises(AttributeError, match="set_options"):
        env.set_attr("task", None)
    with pytest.raises(AttributeError, match="render_frames"):
        env.env_method("render_frames")
    env.unwrapped.set_options([{"speed_kmh": 30.0}, {"speed_kmh": 60.0}])
    with pytest.raises(ValueError, match="same options"):
        env.reset()
