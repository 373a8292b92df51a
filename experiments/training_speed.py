"""What training costs: python -m experiments.training_speed [--repeats 3].

Steps of PPO per second on one thread, 64 environments, over the same kernels by three ways: SteerVecEnv
(one compiled call), stable-baselines3's DummyVecEnv and its SubprocVecEnv over single environments; and
PolicyVecEnv, in which one step is several control periods with a base law. Every repeat measures all of them
in turn, so that a busy machine slows them alike. Beside each stands the share of the time that is
spent inside ``step``: the rest is the networks.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import click
import gymnasium
import torch
from rich.console import Console
from rich.table import Table
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

import steer_env  # noqa: F401  (registers the ids)
from experiments.learning.agent import make_agent
from experiments.learning.arrangement import Arrangement
from experiments.learning.calibration import measured
from experiments.learning.config import TrainConfig
from experiments.learning.vec_env import PolicyVecEnv
from experiments.sb3_vec_env import SteerVecEnv

ENV_ID = "steer_env/SbW-Impedance-v0"
ENVIRONMENTS, ROLLOUT, BATCH, EPOCHS = 64, 128, 1024, 5
OPTIONS: dict[str, Any] = {"randomise": ("plant", "driver", "car", "speed", "manoeuvre")}


def single() -> Any:
    """One environment, as the other two ways take it."""
    return Monitor(gymnasium.make(ENV_ID, **OPTIONS))


def plain_agent(env: VecEnv) -> Any:
    """PPO with the numbers of ``steer-env train``."""
    return PPO(
        "MlpPolicy", env, n_steps=ROLLOUT, batch_size=BATCH, n_epochs=EPOCHS, device="cpu", seed=0,
        policy_kwargs={"net_arch": {"pi": [32, 32], "vf": [64, 64]}, "activation_fn": torch.nn.Tanh},
    )  # fmt: skip


def agents() -> dict[str, Callable[[], Any]]:
    """Makers of the agents by name."""

    def policy_agent() -> Any:
        config = TrainConfig()
        return make_agent(config, PolicyVecEnv(Arrangement(config, measured(config)), ENVIRONMENTS, config.reward, 0))

    return {
        "SteerVecEnv": lambda: plain_agent(SteerVecEnv(ENV_ID, ENVIRONMENTS, **OPTIONS)),
        "DummyVecEnv": lambda: plain_agent(DummyVecEnv([single] * ENVIRONMENTS)),
        "SubprocVecEnv": lambda: plain_agent(SubprocVecEnv([single] * ENVIRONMENTS, start_method="fork")),
        "PolicyVecEnv, 5 periods a step, over pid": policy_agent,
    }


def rate(agent: Any, steps: int) -> tuple[float, float]:
    """(Steps per second of ``learn``, share of that time inside ``env.step``)."""
    env, inside = agent.env, 0.0
    bare = env.step

    def timed(actions: Any) -> Any:
        nonlocal inside
        began = time.perf_counter()
        result = bare(actions)
        inside += time.perf_counter() - began
        return result

    env.step = timed
    before, began = agent.num_timesteps, time.perf_counter()
    agent.learn(steps, reset_num_timesteps=False)
    taken = time.perf_counter() - began
    env.step = bare
    return (agent.num_timesteps - before) / taken, inside / taken


@click.command()
@click.option("--repeats", default=3, show_default=True, type=click.IntRange(1), help="How often each way runs.")
def main(repeats: int) -> None:
    """Print steps per second and the share of time in the environment."""
    torch.set_num_threads(1)
    made = {name: make() for name, make in agents().items()}
    for agent in made.values():
        rate(agent, 1)  # one rollout: compiles, and fills caches
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in made}
    for _ in range(repeats):
        for name, agent in made.items():
            found[name].append(rate(agent, ENVIRONMENTS * ROLLOUT))
    table = Table("environments", title=f"PPO, {ENVIRONMENTS} environments, batch {BATCH}, one thread")
    for heading in ("steps/s", "least", "most", "against SteerVecEnv", "time in the environment"):
        table.add_column(heading, justify="right")
    for name, values in found.items():
        rates = [value for value, _ in values]
        ratios = [value / other for (value, _), (other, _) in zip(values, found["SteerVecEnv"], strict=True)]
        share = median(inside for _, inside in values)
        cells = [f"{value:,.0f}" for value in (median(rates), min(rates), max(rates))]
        table.add_row(name, *cells, f"{median(ratios):.2f}", f"{100.0 * share:.0f} %")
    Console(width=120).print(table)
    for agent in made.values():
        agent.env.close()


if __name__ == "__main__":
    main()
