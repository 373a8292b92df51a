"""Whole closed-loop episodes of the environments of a block, compiled around a control law."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from steer_env.envs import batch
from steer_env.envs.batch import Array
from steer_env.envs.blocks import SPEED_OBSERVED
from steer_env.envs.lanes import (
    BLOCK_SIZE,
    COMMAND,
    NOISE_ANGLE,
    NOISE_TORQUE,
    Switches,
    load_observation,
    load_truth,
    make_lanes_period,
)
from steer_env.envs.layout import Truth
from steer_env.physics._jit import compiled_with, named, scalar
from steer_env.physics.control_unit import Observation
from steer_env.physics.lanes import WIDTH, Path, lane_loader, lane_records, lane_storer, part_replacer

Law = Callable[[Observation, Any, Any], Any]


class Score(NamedTuple):
    """Sums over an episode: periods, reward, squared error ((N m)^2 or rad^2); 1 where the wheel was thrown."""

    periods: float
    reward: float
    squared_error: float
    thrown: float


class LookUp(NamedTuple):
    """What a law's parameters have over speed: ``at`` (speed, table) makes the ``record`` that takes the table's place.

    ``paths`` lead to all places of the table, from field number to field number.
    """

    at: Callable[[float, Any], Any]
    record: Any
    paths: tuple[Path, ...]


class LanesRollout(NamedTuple):
    """``run`` takes blocks of ``size`` rows; the law's state, float by float, lies in the rows ``state``."""

    size: int
    state: slice
    run: Callable[..., None]


class _Command(NamedTuple):
    torque: float


_store_command = lane_storer(_Command, COMMAND)
_load_score, _store_score = lane_loader(Score, 0), lane_storer(Score, 0)


def make_lanes_rollout(law: Law, state: Any, switches: Switches, look_up: LookUp | None = None) -> LanesRollout:
    """Compiled periods of one block around a pure control law, whose state is shaped like ``state``.

    Call ``run`` with (law parameters, table to look up in or None, noise [WIDTH, n or more, 2], n, block, lines, table,
    car table, scores [len(Score), WIDTH]); it runs n periods from the block's present state and adds to the scores, in
    each lane until its wheel is thrown.

    What is looked up is so when the speed changes, in a loop of its own: a law without look-ups and calls into the C
    library compiles to vector code.
    """
    n_state, load_state, store_state = lane_records(state, BLOCK_SIZE)
    behind = BLOCK_SIZE + n_state
    period, (n_found, find, parameters_of) = make_lanes_period(switches), _finder(look_up, behind)

    def rollout(
        law_parameters: Any,
        speed_table: Any,
        noise: Array,
        periods: int,
        block: Array,
        lines: Array,
        table: Array,
        car_table: Array,
        scores: Array,
    ) -> None:
        for k in range(periods):
            find(block, speed_table)
            for lane in range(WIDTH):
                given = parameters_of(block, lane, law_parameters)
                command, after = law(load_observation(block, lane), load_state(block, lane), given)
                store_state(block, lane, after)
                _store_command(block, lane, _Command(command))
            for lane in range(WIDTH):
                block[NOISE_ANGLE, lane], block[NOISE_TORQUE, lane] = noise[lane, k, 0], noise[lane, k, 1]
            period(block, lines, table, car_table)
            for lane in range(WIDTH):
                truth, so_far = load_truth(block, lane), _load_score(scores, lane)
                _store_score(scores, lane, _scored(so_far, truth))

    paths = look_up.paths if look_up else ()
    run = compiled_with(named(rollout, law.__module__, law, *switches, *paths), law)
    return LanesRollout(behind + n_found, slice(BLOCK_SIZE, behind), run)


def _finder(look_up: LookUp | None, start: int) -> tuple[int, Callable[..., None], Callable[..., Any]]:
    """(Rows from ``start`` on, function that looks up where the speed changed, function that puts it in its place)."""
    if look_up is None:
        return 0, _find_nothing, _as_they_are
    at, record, paths = look_up
    load, store, put = lane_loader(record, start + 1), lane_storer(record, start + 1), part_replacer(paths)

    def find(b: Any, speed_table: Any) -> None:
        for lane in range(WIDTH):
            speed = b[SPEED_OBSERVED, lane]
            if b[start, lane] != speed:
                store(b, lane, at(speed, speed_table))
                b[start, lane] = speed

    def parameters_of(b: Any, lane: int, parameters: Any) -> Any:
        return put(parameters, load(b, lane))

    names = at, start, *paths
    return 1 + len(record._fields), scalar(named(find, *names)), scalar(named(parameters_of, *names))


@scalar
def _find_nothing(b: Any, speed_table: Any) -> None:
    """Without a table."""


@scalar
def _as_they_are(b: Any, lane: int, parameters: Any) -> Any:
    return parameters


@scalar
def _scored(so_far: Score, truth: Truth) -> Score:
    if so_far.thrown > 0.5:
        return so_far
    return Score(
        so_far.periods + 1.0,
        so_far.reward + batch.reward_of(truth),
        so_far.squared_error + truth.error * truth.error,
        truth.unstable,
    )
