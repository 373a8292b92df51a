"""Compiled entry points over rows: start and one period of many environments, a whole episode."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.layout import LINE_LENGTH, LINES, OBSERVATION_LIMIT, PARAMETERS, STATE, Clock, Truth
from steer_env.envs.period import control_period, set_speed
from steer_env.physics._jit import compiled, compiled_with, named, scalar
from steer_env.physics.control_unit import Observation
from steer_env.physics.rows import storer

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_store_clock = STATE.storer("clock")
_episode = PARAMETERS.loader("episode")
LAST_TORQUES = Observation._fields.index("last_torque_1")  # and all after it
_store_observation, _store_truth = storer(Observation, 0), storer(Truth, 0)


@scalar
def reward_of(truth: Truth) -> float:
    """The sum of the reward's parts."""
    return truth.reward_tracking + truth.reward_smoothness + truth.reward_effort


@scalar
def clipped(value: float, limit: float) -> float:
    """The value, or the limit that it exceeds."""
    return min(max(value, -limit), limit)


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
    per_scales: Array,
    observations: Array,
    scaled: NDArray[np.float32],
    truths: Array,
    effects: Any = None,
) -> None:
    """One period of n environments: commands [n] in N m, noise [n, 2].

    Fills observations [n, o] in SI, the same times ``per_scales`` [n, o] and clipped, and truths
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
        _store_observation(observations[i], observation)
        _store_truth(truths[i], truth)
        for j in range(observations.shape[1]):
            scaled[i, j] = clipped(observations[i, j] * per_scales[i, j], OBSERVATION_LIMIT)


@compiled
def step_vector(
    first: int,
    shares: Array,
    rated_torques: Array,
    noise: Array,
    next_noise: Integers,
    periods_left: Integers,
    parameters: Array,
    states: Array,
    lines: Array,
    table: Array,
    car_table: Array,
    per_scale: Array,
    per_rated_torques: Array,
    observations: Array,
    scaled: NDArray[np.float32],
    truths: Array,
    rewards: Array,
    clipped: Flags,
    ended: Flags,
    effects: Any = None,
) -> tuple[int, int]:
    """One period of the environments from ``first`` on, row by row; (how many ended, lack noise).

    ``shares`` [n] of ``rated_torques`` [n] are clipped to +-1. ``noise`` [n, block, 2] is taken at
    ``next_noise`` [n]; ``periods_left`` [n] counts down to the end of the manoeuvre. Parameters,
    states and lines have rows for the n - first environments only. Fills columns of
    ``observations`` [o, n] in SI and ``truths`` [t, n], rows of ``scaled`` [n, o] (times
    ``per_scale`` [o], the last torques times ``per_rated_torques`` [n]), and rewards, clipped, ended [n].
    """
    n_ended, n_lacking = 0, 0
    for i in range(first, shares.shape[0]):
        share, k, row = shares[i], next_noise[i], i - first
        clipped[i] = share < -1.0 or share > 1.0
        observation, truth = control_period(
            min(max(share, -1.0), 1.0) * rated_torques[i],
            noise[i, k, 0],
            noise[i, k, 1],
            parameters[row],
            states[row],
            lines[row],
            table,
            car_table,
            effects,
        )
        _store_observation(observations[:, i], observation)
        _store_truth(truths[:, i], truth)
        for j in range(observations.shape[0]):
            part = observations[j, i] * (per_rated_torques[i] if j >= LAST_TORQUES else per_scale[j])
            scaled[i, j] = min(max(part, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
        rewards[i] = reward_of(truth)
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
            _store_truth(truths[k], truth)
            if truth.unstable > 0.5:
                return k + 1
        return int(truths.shape[0])

    return compiled_with(named(rollout, law.__module__, law), law)
