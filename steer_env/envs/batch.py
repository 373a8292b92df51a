"""Compiled entry points over rows: start and one period of many environments, a whole episode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.layout import LINE_LENGTH, LINES, OBSERVATION_LIMIT, PARAMETERS, STATE, Clock
from steer_env.envs.period import control_period, set_speed
from steer_env.physics._jit import compiled, compiled_with, named
from steer_env.physics.control_unit import Observation

Array = NDArray[np.float64]

_store_clock = STATE.storer("clock")
_episode = PARAMETERS.loader("episode")


def new_rows(n: int) -> tuple[Array, Array, Array]:
    """Empty parameter rows [n, p], state rows [n, s] and delay lines [n, 4, 16]."""
    return (
        np.zeros((n, PARAMETERS.size)),
        np.zeros((n, STATE.size)),
        np.zeros((n, len(LINES), LINE_LENGTH)),
    )


def start_batch(parameters: Array, states: Array, lines: Array, table: Array, car_table: Array) -> None:
    """Bring rows to rest at the start of an episode; called once each, so it stays plain Python."""
    for i in range(parameters.shape[0]):
        states[i, :] = 0.0
        lines[i, :, :] = 0.0
        speed = _episode(parameters[i]).speed
        _store_clock(states[i], Clock(0.0, speed, 0.0))
        set_speed(speed, parameters[i], states[i], table, car_table)


@compiled
def step_batch(
    commands: Array,
    noise: Array,
    parameters: Array,
    states: Array,
    lines: Array,
    table: Array,
    car_table: Array,
    scales: Array,
    observations: Array,
    scaled: NDArray[np.float32],
    truths: Array,
    effects: Any = None,
) -> None:
    """One period of n environments: commands [n] in N m, noise [n, 2].

    Fills observations [n, o] in SI, the same divided by ``scales`` [n, o] and clipped, and truths
    [n, t]. ``effects`` is one row of the catalogue's effects for all plants, or None.
    """
    for i in range(commands.shape[0]):
        observation, truth = control_period(
            commands[i],
            noise[i, 0],
            noise[i, 1],
            parameters[i],
            states[i],
            lines[i],
            table,
            car_table,
            effects,
        )
        for j in range(len(observation)):
            observations[i, j] = observation[j]
            share = observation[j] / scales[i, j]
            scaled[i, j] = min(max(share, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
        for j in range(len(truth)):
            truths[i, j] = truth[j]


@compiled
def step_vector(
    shares: Array,
    rated_torques: Array,
    skip: NDArray[np.bool_],
    noise: Array,
    next_noise: NDArray[np.int64],
    periods_left: NDArray[np.int64],
    parameters: Array,
    states: Array,
    lines: Array,
    table: Array,
    car_table: Array,
    scales: Array,
    observations: Array,
    scaled: NDArray[np.float32],
    truths: Array,
    rewards: Array,
    clipped: NDArray[np.bool_],
    ended: NDArray[np.bool_],
    effects: Any = None,
) -> tuple[int, int]:
    """One period of the n environments that are not skipped; (how many ended, lack noise).

    ``shares`` [n] of ``rated_torques`` [n] are clipped to +-1. ``noise`` [n, block, 2] is taken at
    ``next_noise`` [n]; ``periods_left`` [n] counts down to the end of the manoeuvre. Fills rows of
    ``observations``, ``scaled`` and ``truths`` as ``step_batch`` does, and rewards, clipped, ended
    [n]; rows of skipped environments stay as they are.
    """
    n_ended, n_lacking = 0, 0
    for i in range(shares.shape[0]):
        if skip[i]:
            continue
        share, k = shares[i], next_noise[i]
        clipped[i] = share < -1.0 or share > 1.0
        observation, truth = control_period(
            min(max(share, -1.0), 1.0) * rated_torques[i],
            noise[i, k, 0],
            noise[i, k, 1],
            parameters[i],
            states[i],
            lines[i],
            table,
            car_table,
            effects,
        )
        for j in range(len(observation)):
            observations[i, j] = observation[j]
            part = observation[j] / scales[i, j]
            scaled[i, j] = min(max(part, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
        for j in range(len(truth)):
            truths[i, j] = truth[j]
        rewards[i] = truth.reward_tracking + truth.reward_smoothness + truth.reward_effort
        next_noise[i] = k + 1
        n_lacking += next_noise[i] == noise.shape[1]
        periods_left[i] -= 1
        ended[i] = truth.unstable > 0.5 or periods_left[i] <= 0
        n_ended += ended[i]
    return n_ended, n_lacking


def make_rollout(law: Callable[[Observation, Any, Any], Any]) -> Callable[..., int]:
    """A compiled closed-loop episode around a pure control law.

    The law is (observation, state, parameters) -> (torque, new state).

    The result runs ``truths.shape[0]`` periods of one environment from its present rows: call it
    with (law state, law parameters, first observation, noise [T, 2], parameter row, state row,
    lines, table, car table, truths [T, t]); it returns how many periods ran before the episode
    ended or turned unstable.
    """

    def rollout(
        law_state: Any,
        law_parameters: Any,
        observation: Any,
        noise: Array,
        p_row: Array,
        s_row: Array,
        lines: Array,
        table: Array,
        car_table: Array,
        truths: Array,
        effects: Any = None,
    ) -> int:
        for k in range(truths.shape[0]):
            command, law_state = law(observation, law_state, law_parameters)
            observation, truth = control_period(
                command, noise[k, 0], noise[k, 1], p_row, s_row, lines, table, car_table, effects
            )
            for j in range(len(truth)):
                truths[k, j] = truth[j]
            if truth.unstable > 0.5:
                return k + 1
        return int(truths.shape[0])

    return compiled_with(named(rollout, law.__module__, law), law)
