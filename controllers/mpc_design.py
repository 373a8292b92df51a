"""The quadratic programme of mpc, from the plant's linear model; condensed, so that only the moves are unknown.

Over a horizon the motor's target v, seen from the torque that holds the aim, is straight between
values at a few periods, the moves. With the twist z = (twist, rate, motor torque), seen from the aim
as well,

    sum  (C z)^2 + (ratio v / effort)^2   +   cost to go after the last move

has one minimum, linear in where z starts. The cost to go is that of the LQ optimum without limits,
so with a move in every period, or a long horizon, the first move is the LQ gain's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from controllers.blocks import Notch
from controllers.hardware import bar_notch
from controllers.kalman_design import Matrix, discrete, kalman_gains, twist_matrices
from controllers.law import Gain, with_gains
from steer_env.plants import Plant

# Periods at which the target may bend. Nine periods are what a motor needs from rest to its rated torque,
# and about as long as an aim that follows the hand may be taken as held.
MOVES = (0, 1, 2, 4, 8)


class Design(NamedTuple):
    """The weights: tuning axes of the controller; units as in MpcParameters."""

    effort: float
    hand: float = 30.0
    load: float = 0.6


class Problem(NamedTuple):
    """z to the next by the target, and what a period costs: step, cost [3, 3], push [3, 1], effort [1, 1]."""

    step: Matrix
    push: Matrix
    cost: Matrix
    effort: Matrix


class Programme(NamedTuple):
    """min v'H v / 2 + (slopes z)'v over n moves: H, increments [n, n], slopes, best [n, 3], spans [n].

    ``best`` z is the minimum without limits, ``increments`` v what the moves change by, each over
    ``spans`` periods; the first starts from the last target.
    """

    H: Matrix
    slopes: Matrix
    best: Matrix
    increments: Matrix
    spans: Matrix


def problem_of(plant: Plant, period: float, effort: float) -> Problem:
    """The twist's model one period on, and the weights."""
    A, B, C = twist_matrices(plant)
    step, push = discrete(A, B, period)
    return Problem(step, push, C.T @ C, np.array([[(plant.steering.motor_ratio / effort) ** 2]]))


def cost_to_go(q: Problem) -> Matrix:
    """What is still to pay from a start [3, 3], if no limit acts: the Riccati equation's solution."""
    return np.asarray(solve_discrete_are(q.step, q.push, q.cost, q.effort))


def lq_gain(q: Problem) -> Matrix:
    """K [1, 3] of the optimum without limits, v = -K z."""
    S = cost_to_go(q)
    return np.asarray(np.linalg.solve(q.effort + q.push.T @ S @ q.push, q.push.T @ S @ q.step), np.float64)


def interpolation(moves: Sequence[int]) -> Matrix:
    """From moves to the target in every period up to the last move, [periods, n]."""
    periods = np.arange(moves[-1] + 1)
    return np.column_stack([np.interp(periods, moves, unit) for unit in np.eye(len(moves))])


def condensed(q: Problem, moves: Sequence[int], final: Matrix) -> Programme:
    """The programme over ``moves`` in periods, the first at 0, with the cost ``final`` [3, 3] of the end."""
    n, place = len(moves), interpolation(moves)
    free, forced = np.eye(3), np.zeros((3, n))
    H, slopes = np.zeros((n, n)), np.zeros((n, 3))
    for v in place[:, None, :]:
        H += forced.T @ q.cost @ forced + v.T @ q.effort @ v
        slopes += forced.T @ q.cost @ free
        free, forced = q.step @ free, q.step @ forced + q.push @ v
    H += forced.T @ final @ forced
    slopes += forced.T @ final @ free
    size = H[0, 0]  # leaves the optimum as it is and makes the solver's tolerances relative
    H, slopes = 0.5 * (H + H.T) / size, slopes / size
    spans = np.diff([-1, *moves]).astype(float)
    return Programme(H, slopes, -np.linalg.solve(H, slopes), np.eye(n) - np.eye(n, k=-1), spans)


def design(plant: Plant, causality: str, period: float, weights: Mapping[str, Gain]) -> tuple[Design, dict[str, Any]]:
    """(Weights, parameters of MpcParameters that follow from them)."""
    stiff = bar_notch(plant, period) != Notch()
    soft = 4.0 if causality == "impedance" else 6.0
    chosen = with_gains(Design(effort=0.1 if stiff else soft), weights, "mpc")
    q = problem_of(plant, period, chosen.effort)
    filtered = kalman_gains(plant, period, chosen.hand, chosen.load)
    return chosen, {**condensed(q, MOVES, cost_to_go(q))._asdict(), **filtered}
