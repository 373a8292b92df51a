"""Compiled entry points over blocks of lanes: start and one period of many environments."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from steer_env.envs import batch
from steer_env.envs.batch import Array, Flags, Integers
from steer_env.envs.lanes import (
    BENCH,
    BENCH_ROWS,
    BLOCK_SIZE,
    COMMAND,
    NOISE_ANGLE,
    NOISE_TORQUE,
    PARAMETER_ROWS,
    SPEED,
    STATE_ROWS,
    Switches,
    load_truth,
    make_lanes_period,
)
from steer_env.envs.layout import LINE_LENGTH, LINES, OBSERVATION_LIMIT, PARAMETERS, Truth
from steer_env.envs.parts import set_speed
from steer_env.physics._jit import compiled, compiled_with, named
from steer_env.physics.control_unit import Observation
from steer_env.physics.lanes import WIDTH

OBSERVED = BENCH_ROWS.start + BENCH["observation"].start
TRUE = BENCH_ROWS.start + BENCH["truth"].start
SPEED_OBSERVED = OBSERVED + Observation._fields.index("speed")
SPEED_GIVEN = PARAMETERS.column("episode", "speed")
CACHE_LINE = 8  # floats
N_OBSERVED, N_TRUE = len(Observation._fields), len(Truth._fields)


def new_blocks(n: int, size: int = BLOCK_SIZE) -> tuple[Array, Array]:
    """Empty blocks [n, size, WIDTH] and their delay lines [n, 4, 16, WIDTH].

    Blocks start at a cache line of the processor: a vector that straddles two costs two loads.
    """
    room = np.zeros(n * size * WIDTH + CACHE_LINE)
    start = -(room.ctypes.data // room.itemsize) % CACHE_LINE
    blocks = room[start : start + n * size * WIDTH].reshape(n, size, WIDTH)
    return blocks, np.zeros((n, len(LINES), LINE_LENGTH, WIDTH))


@compiled
def start_lane(blocks: Array, lines: Array, i: int, row: Array, table: Array, car_table: Array) -> None:
    """Bring environment ``i`` with a parameter row to rest at the start of an episode."""
    block, lane = blocks[i // WIDTH], i % WIDTH
    block[:, lane] = 0.0
    lines[i // WIDTH, :, :, lane] = 0.0
    block[PARAMETER_ROWS, lane] = row
    speed = row[SPEED_GIVEN]
    block[SPEED, lane] = block[SPEED_OBSERVED, lane] = speed
    set_speed(speed, block[PARAMETER_ROWS, lane], block[STATE_ROWS, lane], table, car_table)


@cache
def step_blocks(switches: Switches) -> Callable[..., tuple[int, int]]:
    """The compiled period of full blocks: as ``batch.step_vector``, with blocks and lines for its rows."""
    period = make_lanes_period(switches)

    def step(
        shares: Array,
        rated_torques: Array,
        noise: Array,
        next_noise: Integers,
        periods_left: Integers,
        blocks: Array,
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
    ) -> tuple[int, int]:
        n_ended, n_lacking = 0, 0
        for k in range(blocks.shape[0]):
            block, first = blocks[k], k * WIDTH
            for lane in range(WIDTH):
                i = first + lane
                share, draw = shares[i], next_noise[i]
                clipped[i] = share < -1.0 or share > 1.0
                block[COMMAND, lane] = min(max(share, -1.0), 1.0) * rated_torques[i]
                block[NOISE_ANGLE, lane], block[NOISE_TORQUE, lane] = noise[i, draw, 0], noise[i, draw, 1]
                next_noise[i] = draw + 1
                n_lacking += draw + 1 == noise.shape[1]
            period(block, lines[k], table, car_table)
            for j in range(N_OBSERVED):
                per_torque = j >= batch.LAST_TORQUES
                for lane in range(WIDTH):
                    value, i = block[OBSERVED + j, lane], first + lane
                    observations[j, i] = value
                    part = value * (per_rated_torques[i] if per_torque else per_scale[j])
                    scaled[i, j] = min(max(part, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
            for j in range(N_TRUE):
                for lane in range(WIDTH):
                    truths[j, first + lane] = block[TRUE + j, lane]
            for lane in range(WIDTH):
                i, truth = first + lane, load_truth(block, lane)
                rewards[i] = batch.reward_of(truth)
                periods_left[i] -= 1
                ended[i] = truth.unstable > 0.5 or periods_left[i] <= 0
                n_ended += ended[i]
        return n_ended, n_lacking

    return compiled_with(named(step, *switches))
