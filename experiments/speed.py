"""How fast the environments step, as ratios measured in one run on one thread.

    python -m experiments.speed [--repeats 5]

Every repeat measures all cases one after the other, so that a busy machine slows them alike; a
ratio is the median of the repeats' ratios. Absolute figures hold for the machine at that moment.
Actions are the same small numbers in every step; resets at the ends of episodes are included.
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable
from statistics import median
from typing import Any

import click
import gymnasium
import numpy as np
from gymnasium.vector import SyncVectorEnv
from rich.console import Console
from rich.table import Table

import controllers
import steer_env  # noqa: F401  (registers the ids)
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.plants import PLANTS, Reference

OURS = "steer_env/EPAS-Impedance-v0"
SIZES = (1, 64, 1024)
SLICE = 0.3  # s that one measurement takes
CONTROLLER = "pid"

Run = Callable[[int], int]
"""Makes n calls and returns how many environment steps they were."""


def single(env_id: str, action: Any) -> Run:
    """Calls of ``env.step`` as ``gymnasium.make`` wraps it, reset where an episode ends."""
    env = gymnasium.make(env_id)
    env.reset(seed=0)

    def step(n: int) -> int:
        for _ in range(n):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return n

    return step


def vector(env: Any, action: Any) -> Run:
    """Calls of ``step`` of a vector environment, which resets itself."""
    actions = np.full(env.action_space.shape, action, env.action_space.dtype)
    env.reset(seed=0)

    def step(n: int) -> int:
        for _ in range(n):
            env.step(actions)
        return n * int(env.num_envs)

    return step


def episodes() -> Run:
    """Whole closed-loop episodes in compiled code: setup, noise, all periods with a controller."""
    task = Task()
    law = controllers.make(CONTROLLER, PLANTS["EPAS"], Reference(), "impedance")

    def step(n: int) -> int:
        return sum(len(run(task, law, seed).signals) for seed in range(n))

    return step


def cases() -> dict[str, Run]:
    """Every case by its name."""
    found = {
        "CartPole-v1, make": single("CartPole-v1", 1),
        "ours, make": single(OURS, np.array([0.1], np.float32)),
    }
    for n in SIZES:
        native = gymnasium.make_vec(OURS, n, vectorization_mode="vector_entry_point")
        found[f"ours, SteerVectorEnv {n}"] = vector(native, 0.1)
        found[f"ours, SyncVectorEnv {n}"] = vector(SyncVectorEnv([lambda: gymnasium.make(OURS)] * n), 0.1)
        found[f"CartPole-v1, native vector {n}"] = vector(gymnasium.make_vec("CartPole-v1", n), 1)
    found[f"ours, compiled episodes with {CONTROLLER}"] = episodes()
    return found


def measured(repeats: int, found: dict[str, Run]) -> dict[str, list[float]]:
    """Steps per second of each case in each repeat, in calls that fill SLICE seconds."""
    calls = {}
    for name, step in found.items():
        step(1)  # compiles
        n, spent = 1, 0.0
        while spent < 0.2 * SLICE:
            n, start = 2 * n, time.perf_counter()
            step(n)
            spent = time.perf_counter() - start
        calls[name] = max(round(n * SLICE / spent), 1)
    rates: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(repeats):
        for name, step in found.items():
            start = time.perf_counter()
            steps = step(calls[name])
            rates[name].append(steps / (time.perf_counter() - start))
    return rates


def memory_of_one(n: int = 1024) -> float:
    """Bytes that one more environment of a SteerVectorEnv holds, its generator included."""
    gymnasium.make_vec(OURS, 1, vectorization_mode="vector_entry_point").reset(seed=0)
    tracemalloc.start()
    env = gymnasium.make_vec(OURS, n, vectorization_mode="vector_entry_point")
    kept = env.reset(seed=0)  # what a step returns is held by its caller
    gc.collect()
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return held / n


def compared() -> list[tuple[str, str]]:
    """Which case is divided by which."""
    pairs = [("ours, make", "CartPole-v1, make")]
    for n in SIZES:
        pairs += [(f"ours, SteerVectorEnv {n}", f"ours, SyncVectorEnv {n}")]
        pairs += [(f"ours, SteerVectorEnv {n}", f"CartPole-v1, native vector {n}")]
    whole = f"ours, compiled episodes with {CONTROLLER}"
    return [*pairs, (f"ours, SteerVectorEnv {SIZES[-1]}", whole), (whole, "ours, make")]


def tables(rates: dict[str, list[float]]) -> tuple[Table, Table]:
    """Steps per second, and the ratios."""
    absolute = Table("case", title="environment steps per second (control periods of 1 ms)")
    for heading in ("median", "least", "most"):
        absolute.add_column(heading, justify="right")
    for name, values in rates.items():
        absolute.add_row(name, *(f"{value:,.0f}" for value in (median(values), min(values), max(values))))
    ratios = Table("case", "against", title="ratios within one repeat")
    for heading in ("median", "least", "most"):
        ratios.add_column(heading, justify="right")
    for name, other in compared():
        shares = [a / b for a, b in zip(rates[name], rates[other], strict=True)]
        ratios.add_row(name, other, *(f"{share:.3g}" for share in (median(shares), min(shares), max(shares))))
    return absolute, ratios


@click.command()
@click.option("--repeats", default=5, show_default=True, type=click.IntRange(1), help="How often each case runs.")
def main(repeats: int) -> None:
    """Print steps per second, ratios and memory."""
    console = Console(width=120)
    for table in tables(measured(repeats, cases())):
        console.print(table)
    console.print(f"memory of one environment in a SteerVectorEnv of 1024: {memory_of_one() / 1024:.2f} KiB")


if __name__ == "__main__":
    main()
