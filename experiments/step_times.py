"""Steps of a control law timed one by one, compiled and in Python, over recorded observations.

This stands apart from experiments.step_cost, which is also run as a program: compiled code that
calls the interpreter is kept on disk under its module's name, which must not be __main__.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import objmode
from numpy.typing import NDArray

from experiments.rollout import first_observation
from steer_env.envs import batch
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.task import Task, prepare
from steer_env.interface import Controller, Law, Observation
from steer_env.physics._jit import compiled_with, named, scalar
from steer_env.physics.rows import loader

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_observation = loader(Observation, 0)


def recorded(task: Task, controller: Controller, steps: int, seed: int = 0) -> Array:
    """Observations [steps, fields] of a closed loop with the controller."""
    rng = np.random.default_rng(seed)
    setup = prepare(task, rng, PERIOD)
    parameters, states, lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, states, lines, setup.table, setup.car_table)
    noise = rng.standard_normal((steps, 1, 2))
    seen, truths = np.array([first_observation(setup)]), np.zeros((1, len(Truth._fields)))
    scales, scaled = np.ones(seen.shape), np.zeros(seen.shape, np.float32)
    rows, command = np.zeros((steps, seen.size)), np.zeros(1)
    controller.reset(PERIOD)
    for k in range(steps):
        rows[k] = seen[0]
        command[0] = controller(Observation(*seen[0].tolist()))
        batch.step_batch(
            command, noise[k], parameters, states, lines, setup.table, setup.car_table, scales, seen, scaled, truths
        )
    return rows


def python_pass(controller: Controller, rows: Array) -> tuple[Array, Array, Mask]:
    """(Times [n] in ns, torques [n] in N m, whether a limit of mpc acted [n]) of a controller called from Python."""
    times, torques, limited = np.zeros(len(rows)), np.zeros(len(rows)), np.zeros(len(rows), np.bool_)
    controller.reset(PERIOD)
    for k, observation in enumerate([Observation(*row) for row in rows.tolist()]):
        start = time.perf_counter_ns()
        torques[k] = controller(observation)
        times[k] = time.perf_counter_ns() - start
        limited[k] = getattr(controller.state(), "active", 0.0) != 0.0
    return times, torques, limited


@scalar
def nothing(o: Observation, x: Any, p: Any) -> tuple[float, Any]:
    """A law that does nothing."""
    return 0.0, x


@scalar
def clock() -> float:
    """Now, in ns; from compiled code too."""
    with objmode(now="float64"):
        now = float(time.perf_counter_ns())
    return now


@cache
def timed(law: Law) -> Callable[..., None]:
    """A compiled loop (state, parameters, rows [n, fields], each, torques [n], times [n]) over observations.

    Fills torques in N m and, where ``each`` is true, the time in ns from the end of one step to that
    of the next.
    """

    def loop(state: Any, parameters: Any, rows: Array, each: bool, torques: Array, times: Array) -> None:
        last = clock()
        for k in range(rows.shape[0]):
            torques[k], state = law(_observation(rows[k]), state, parameters)
            if each:
                now = clock()
                times[k] = now - last
                last = now

    return compiled_with(named(loop, law.__module__, law), law)


def compiled_passes(law: Law, state: Any, parameters: Any, rows: Array, passes: int) -> tuple[Array, Array, Array]:
    """(Means [passes] and times [passes, n] of a step in ns, torques [n] in N m) of a law over observations."""
    run, torques = timed(law), np.zeros(len(rows))
    means, times = np.zeros(passes), np.zeros((passes, len(rows)))
    run(state, parameters, rows[:2], True, torques, times[0])  # compiles
    for k in range(passes):
        run(state, parameters, rows, True, torques, times[k])
        start = time.perf_counter_ns()
        run(state, parameters, rows, False, torques, times[k])
        means[k] = (time.perf_counter_ns() - start) / len(rows)
    return means, times, torques
