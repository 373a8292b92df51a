"""One environment in one array, so that a step from Python hands little over: what a call costs is its arguments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.batch import clipped
from steer_env.envs.layout import LINE_LENGTH, LINES, OBSERVATION_LIMIT, PARAMETERS, STATE, Truth
from steer_env.envs.period import control_period
from steer_env.physics._jit import compiled
from steer_env.physics.control_unit import Observation
from steer_env.physics.rows import storer

Array = NDArray[np.float64]
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


@compiled
def step_cell(
    command: float,
    noise_angle: float,
    noise_torque: float,
    cell: Array,
    scaled: NDArray[np.float32],
    table: Array,
    car_table: Array,
    effects: Any = None,
) -> None:
    """One period with a command in N m and two draws of noise: changes the cell, fills ``scaled`` [n_observed].

    The cell's scales are reciprocal: what one SI unit of each observation is in units of the scaled one.
    """
    lines = cell[LINE_CELLS].reshape((len(LINES), LINE_LENGTH))
    p_row, s_row = cell[PARAMETER_CELLS], cell[STATE_CELLS]
    observation, truth = control_period(
        command, noise_angle, noise_torque, p_row, s_row, lines, table, car_table, effects
    )
    _store_truth(cell, truth)
    _store_observation(cell, observation)
    for j in range(N_OBSERVED):
        part = cell[OBSERVED_CELLS.start + j] * cell[SCALE_CELLS.start + j]
        scaled[j] = clipped(part, OBSERVATION_LIMIT)
