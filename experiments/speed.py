"""How fast the environments step, as ratios measured in one run on one thread.

    python -m experiments.speed [--repeats 5] [--start/--no-start] [--busy]

Every repeat measures all cases one after the other, in short slices that take turns, in seconds of the processor: what
others on the machine run in between does not count. A ratio is the median of the repeats' ratios. Absolute figures hold
for the machine at that moment. Actions are the same small numbers in every step. Whole episodes include their setup and
the drawing of noise.

``limit: C`` is the period written in C (``speed_limit``), also without fused products, which the environments may not
have: their bits are the same in Python, compiled and in lanes. gym-electric-motor is measured where it is installed.
"""

from __future__ import annotations

import gc
import subprocess
import sys
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
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
from experiments import speed_limit
from experiments.rollout import scored
from experiments.speed_split import split_table
from experiments.start_times import start_times
from steer_env.envs.task import Task
from steer_env.physics.lanes import WIDTH
from steer_env.plants import PLANTS, Reference

OURS = "steer_env/EPAS-Impedance-v0"
SIZES = (1, 64, 1024)
SLICE = 1e-2  # s of the processor that one slice takes, where one call is not longer
SLICES = 10  # of each case in one repeat
CONTROLLER = "pid"
EPISODES = 2 * WIDTH
WHOLE = Task()  # the paper's frequency response: what the benchmark drives most
BUSY = ("CartPole-v1, make", "ours, make", "ours, SteerVectorEnv 64", "ours, SteerVectorEnv 1024")
LIMITS = {
    "limit: C, periods in lanes": (),
    "limit: C without fused products": (speed_limit.NO_FUSING,),
}
MOTOR_ENV = "Cont-TC-PMSM-v0"

Run = Callable[[int], int]
"""Makes n calls and returns how many environment steps they were."""


def single(env_id: str, action: Any) -> Run:
    """Calls of ``env.step`` as ``gymnasium.make`` wraps it, reset where an episode ends."""
    return _stepping(gymnasium.make(env_id), action)


def _stepping(env: Any, action: Any) -> Run:
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


def episodes(controller: Any) -> Run:
    """Whole closed-loop episodes of EPISODES environments: setup, noise, all periods with a controller, scores."""

    def step(n: int) -> int:
        return sum(int(scored(WHOLE, controller, range(EPISODES))[:, 0].sum()) for _ in range(n))

    return step


def kernel(run: Callable[[speed_limit.Block, int], None], periods: int = 25) -> Run:
    """Periods of one block of lanes in compiled code, nothing else."""
    block = speed_limit.Block()

    def step(n: int) -> int:
        for _ in range(n):
            run(block, periods)
        return n * periods * WIDTH

    return step


def electric_motor() -> Run | None:
    """gym-electric-motor's torque control of a synchronous motor; None where it is not installed."""
    try:
        gem = import_module("gym_electric_motor")
    except ImportError:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own, about its observation space
        env = gem.make(MOTOR_ENV)
        return _stepping(env, np.zeros(env.action_space.shape, env.action_space.dtype))


def cases() -> dict[str, Run]:
    """Every case by its name."""
    found = {
        "CartPole-v1, make": single("CartPole-v1", 1),
        "ours, make": single(OURS, np.array([0.1], np.float32)),
    }
    motor = electric_motor()
    if motor is not None:
        found["gym-electric-motor, make"] = motor
    for n in SIZES:
        native = gymnasium.make_vec(OURS, n, vectorization_mode="vector_entry_point")
        found[f"ours, SteerVectorEnv {n}"] = vector(native, 0.1)
        found[f"ours, SyncVectorEnv {n}"] = vector(SyncVectorEnv([lambda: gymnasium.make(OURS)] * n), 0.1)
        found[f"CartPole-v1, native vector {n}"] = vector(gymnasium.make_vec("CartPole-v1", n), 1)
    found["ours, periods in lanes"] = kernel(speed_limit.compiled_python())
    for name, flags in LIMITS.items():
        limit = speed_limit.compiled_c(*flags)
        if limit is not None:
            found[name] = kernel(limit)
    found["ours, whole episodes"] = episodes(speed_limit.Proportional())
    found[f"ours, whole episodes with {CONTROLLER}"] = episodes(_controller())
    return found


def _controller() -> Any:
    return controllers.make(CONTROLLER, PLANTS["EPAS"], Reference(), "impedance")


def measured(
    repeats: int, found: dict[str, Run], clock: Callable[[], float] = time.process_time
) -> dict[str, list[float]]:
    """Steps per second of each case in each repeat: the median of its slices."""
    calls = {}
    for name, step in found.items():
        step(1)  # compiles
        n, spent = 1, 0.0
        while spent < 0.5 * SLICE:
            n, start = 2 * n, clock()
            step(n)
            spent = clock() - start
        calls[name] = max(round(n * SLICE / spent), 1)
    rates: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(repeats):
        slices: dict[str, list[float]] = {name: [] for name in found}
        for _ in range(SLICES):
            for name, step in found.items():
                start = clock()
                steps = step(calls[name])
                slices[name].append(steps / (clock() - start))
        for name, values in slices.items():
            rates[name].append(median(values))
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


@contextmanager
def busy_neighbour() -> Iterator[subprocess.Popen[bytes]]:
    """A process that keeps one processor busy."""
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def beside_neighbour(repeats: int, found: dict[str, Run]) -> dict[str, list[float]]:
    """Speed of each case beside a busy process over its speed alone, by the clock on the wall."""
    ratios: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(repeats):
        alone = measured(1, found, time.perf_counter)
        with busy_neighbour():
            beside = measured(1, found, time.perf_counter)
        for name, values in ratios.items():
            values.append(beside[name][0] / alone[name][0])
    return ratios


def compared(found: Iterable[str]) -> list[tuple[str, str]]:
    """Which case is divided by which, of the cases that were found."""
    pairs = [("ours, make", "CartPole-v1, make"), ("ours, make", "gym-electric-motor, make")]
    for n in SIZES:
        pairs += [(f"ours, SteerVectorEnv {n}", f"ours, SyncVectorEnv {n}")]
        pairs += [(f"ours, SteerVectorEnv {n}", f"CartPole-v1, native vector {n}")]
    lanes, whole = "ours, periods in lanes", "ours, whole episodes"
    pairs += [*((lanes, limit) for limit in LIMITS), (whole, lanes), (f"{whole} with {CONTROLLER}", whole)]
    pairs += [(f"ours, SteerVectorEnv {SIZES[-1]}", lanes)]
    return [pair for pair in pairs if {*pair} <= {*found}]


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
    for name, other in compared(rates):
        shares = [a / b for a, b in zip(rates[name], rates[other], strict=True)]
        ratios.add_row(name, other, *(f"{share:.3g}" for share in (median(shares), min(shares), max(shares))))
    return absolute, ratios


@click.command()
@click.option("--repeats", default=5, show_default=True, type=click.IntRange(1), help="How often each case runs.")
@click.option("--start/--no-start", default=True, show_default=True, help="Time a fresh start in other processes.")
@click.option("--busy", is_flag=True, help="Measure the main cases beside a busy process too.")
def main(repeats: int, start: bool, busy: bool) -> None:
    """Print steps per second, ratios, where the time goes, agreement with C, memory, and times of a fresh start."""
    console = Console(width=120)
    found = cases()
    for table in tables(measured(repeats, found)):
        console.print(table)
    console.print(split_table(WHOLE, _controller(), CONTROLLER, repeats))
    if "gym-electric-motor, make" not in found:
        console.print("gym-electric-motor: not installed")
    limit = speed_limit.compiled_c()
    if limit is None:
        console.print("limit in C: no compiler found")
    else:
        apart = speed_limit.check(speed_limit.compiled_python(), limit)
        console.print(f"plant states in C and in ours differ by at most {apart:.1e} of their largest value")
    console.print(f"memory of one environment in a SteerVectorEnv of 1024: {memory_of_one() / 1024:.2f} KiB")
    if start:
        for name, seconds in start_times(OURS, repeats).items():
            console.print(f"{name}: {seconds:.2f} s")
    if busy:
        for name, shares in beside_neighbour(repeats, {name: found[name] for name in BUSY}).items():
            console.print(f"{name}: {median(shares):.2f} of its speed beside a busy process")


if __name__ == "__main__":
    main()
