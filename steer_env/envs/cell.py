"""One environment in one array, so that a step from Python hands little over: what a call costs is its arguments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.batch import clipped, reward_of
from steer_env.envs.layout import LINE_LENGTH, LINES, OBSERVATION_LIMIT, PARAMETERS, STATE, Truth
from steer_env.envs.period import control_period
from steer_env.physics._direct import direct
from steer_env.physics.control_unit import Observation
from steer_env.physics.rows import storer

Array = NDArray[np.float64]
NOISE_BLOCK = 32  # periods of noise drawn at once: half a KiB for each environment
PERIODS = STATE.column("clock", "period")
N_OBSERVED, N_TRUE = len(Observation._fields), len(Truth._fields)
_LENGTHS = (PARAMETERS.size, STATE.size, len(LINES) * LINE_LENGTH, N_OBSERVED, N_TRUE, N_OBSERVED)
_ENDS = np.cumsum(_LENGTHS).tolist()
PARAMETER_CELLS, STATE_CELLS, LINE_CELLS, SCALE_CELLS, TRUE_CELLS, OBSERVED_CELLS = (
    slice(end - length, end) for length, end in zip(_LENGTHS, _ENDS, strict=True)
)
REPORT_CELLS = slice(TRUE_CELLS.start, OBSERVED_CELLS.stop)
CELL_SIZE = OBSERVED_CELLS.stop
_store_truth, _store_observation = storer(Truth, TRUE_CELLS.start), storer(Observation, OBSERVED_CELLS.start)


def rows_of(cell: Array) -> tuple[Array, Array, Array]:
    """Views of a cell as ``batch.new_rows`` of one environment."""
    lines = cell[LINE_CELLS].reshape(1, len(LINES), LINE_LENGTH)
    return cell[PARAMETER_CELLS].reshape(1, -1), cell[STATE_CELLS].reshape(1, -1), lines


@direct
def step_cell(
    command: float,
    noise: Array,
    cell: Array,
    lines: Array,
    scaled: NDArray[np.float32],
    table: Array,
    car_table: Array,
    effects: Any,
) -> float:
    """One period with a command in N m: changes the cell, fills ``scaled`` [n_observed], returns the reward.

    ``noise`` [NOISE_BLOCK, 2] are the draws of the present block of periods, ``lines`` [4, 16] the cell's own delay
    lines. The cell's scales are reciprocal: what one SI unit of each observation is in units of the scaled one.
    """
    p_row, s_row = cell[PARAMETER_CELLS], cell[STATE_CELLS]
    k = int(s_row[PERIODS]) % NOISE_BLOCK
    observation, truth = control_period(
        command, float(noise[k, 0]), float(noise[k, 1]), p_row, s_row, lines, table, car_table, effects
    )
    _store_truth(cell, truth)
    _store_observation(cell, observation)
    for j in range(N_OBSERVED):
        part = cell[OBSERVED_CELLS.start + j] * cell[SCALE_CELLS.start + j]
        scaled[j] = clipped(part, OBSERVATION_LIMIT)
    return float(reward_of(truth))
