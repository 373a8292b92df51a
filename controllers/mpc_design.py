"""The quadratic programme of mpc, from the plant's linear model; condensed, so that only the moves are unknown.

Over a horizon the motor's target v, seen from the torque that holds the aim, is straight between
values at a few periods, the moves. With the twist z, seen from the aim as well, and d = v_k - v_(k-1),

    sum  (C z)^2 + (ratio v / effort)^2 + (smoothness ratio d)^2   +   cost to go after the last move

has one minimum, linear in where it starts. The cost to go is that of the LQ optimum without limits,
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

# Periods at which the target may bend: close while the slew limit acts, far apart to see the torque limit.
MOVES = (0, 1, 2, 4, 8, 16, 32)


class Design(NamedTuple):
    """The weights: tuning axes of the controller; units as in MpcParameters."""

    effort: float
    smoothness: float
    hand: float = 30.0
    load: float = 3.0


class Problem(NamedTuple):
    """Start (twist, rate, motor torque, last target) to the next, and what a period costs.

    step [4, 4], push [4, 1], cost [4, 4] of the start, effort [1, 1] of the target, cross [4, 1].
    """

    step: Matrix
    push: Matrix
    cost: Matrix
    effort: Matrix
    cross: Matrix


class Programme(NamedTuple):
    """min v'H v / 2 + (slopes z)'v over n moves; ``best`` z without limits, ``increments`` v = bends."""

    H: Matrix  # [n, n], of 1/2 v'H v
    slopes: Matrix  # [n, 4]
    best: Matrix  # [n, 4]
    increments: Matrix  # [n, n]
    spans: Matrix  # [n], periods that a bend may take


def problem_of(plant: Plant, period: float, effort: float, smoothness: float) -> Problem:
    """The twist with its last target remembered, and the weights."""
    A, B, C = twist_matrices(plant)
    step, push = discrete(A, B, period)
    ratio = plant.steering.motor_ratio
    change = np.array([[(smoothness * ratio) ** 2]])
    return Problem(
        np.block([[step, np.zeros((3, 1))], [np.zeros((1, 4))]]),
        np.vstack([push, [[1.0]]]),
        np.block([[C.T @ C, np.zeros((3, 1))], [np.zeros((1, 3)), change]]),
        np.array([[(ratio / effort) ** 2]]) + change,
        np.vstack([np.zeros((3, 1)), -change]),
    )


def cost_to_go(q: Problem) -> Matrix:
    """What is still to pay from a start [4, 4], if no limit acts: the Riccati equation's solution."""
    return np.asarray(solve_discrete_are(q.step, q.push, q.cost, q.effort, s=q.cross))


def lq_gain(q: Problem) -> Matrix:
    """K [1, 4] of the optimum without limits, v = -K z."""
    S = cost_to_go(q)
    return np.linalg.solve(q.effort + q.push.T @ S @ q.push, q.push.T @ S @ q.step + q.cross.T)


def interpolation(moves: Sequence[int]) -> Matrix:
    """From moves to the target in every period up to the last move, [periods, n]."""
    periods = np.arange(moves[-1] + 1)
    return np.column_stack([np.interp(periods, moves, unit) for unit in np.eye(len(moves))])


def condensed(q: Problem, moves: Sequence[int], final: Matrix) -> Programme:
    """The programme over ``moves`` in periods, the first at 0, with the cost ``final`` [4, 4] of the end."""
    n, place = len(moves), interpolation(moves)
    free, forced = np.eye(4), np.zeros((4, n))
    H, slopes = np.zeros((n, n)), np.zeros((n, 4))
    for v in place[:, None, :]:
        H += forced.T @ q.cost @ forced + v.T @ q.effort @ v + forced.T @ q.cross @ v + v.T @ q.cross.T @ forced
        slopes += forced.T @ q.cost @ free + v.T @ q.cross.T @ free
        free, forced = q.step @ free, q.step @ forced + q.push @ v
    H += forced.T @ final @ forced
    slopes += forced.T @ final @ free
    size = H[0, 0]  # leaves the optimum as it is and makes the solver's tolerances relative
    H, slopes = 0.5 * (H + H.T) / size, slopes / size
    spans = np.diff([-1, *moves]).astype(float)
    return Programme(H, slopes, -np.linalg.solve(H, slopes), np.eye(n) - np.eye(n, k=-1), spans)


def design(
    plant: Plant, causality: str, period: float, delay: float, weights: Mapping[str, Gain]
) -> tuple[Design, dict[str, Any]]:
    """(Weights, parameters of MpcParameters that follow from them)."""
    stiff = bar_notch(plant, period) != Notch()
    soft = 4.0 if causality == "impedance" else 3.0
    chosen = with_gains(Design(effort=0.1 if stiff else soft, smoothness=0.0), weights, "mpc")
    q = problem_of(plant, period, chosen.effort, chosen.smoothness)
    return chosen, {
        **condensed(q, MOVES, cost_to_go(q))._asdict(),
        **kalman_gains(plant, period, chosen.hand, chosen.load),
    }
