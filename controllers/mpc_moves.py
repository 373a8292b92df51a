"""The first move of mpc's programme: a product of matrices where no limit acts, else solved by DAQP.

The programme is strictly convex and its limits always leave a way (hold the last command), so there
is one solution. If the optimum without limits keeps all of them it is that solution, and nothing
needs solving. Else DAQP (D. Arnström, A. Bemporad, D. Axehill, IEEE TAC 67(8), 2022), a dual
active-set method, starts from the limits that were active a period ago. Compiled code calls it
through the interpreter; it keeps nothing between calls, so the same input gives the same bits.
"""

from __future__ import annotations

from typing import Any

import daqp
import numpy as np
from numba import objmode
from numpy.typing import NDArray

from steer_env.physics._jit import scalar
from steer_env.physics.motor import limited_command

Vector = NDArray[np.float64]
ACCURACY = 1e-10  # N m at the motor by which DAQP may miss a limit; 1e-6 by itself
INACTIVE = 1e-12  # a multiplier below this is rounding
UNSOLVED = -1.0  # in place of a set of active limits


def signs_of(active: float, n: int) -> Vector:
    """Which of n limits are active: 1 the upper, -1 the lower, 0 none; digits of base three of ``active``."""
    code = int(active)
    signs = np.zeros(n)
    for k in range(n):
        code, digit = divmod(code, 3)
        signs[k] = (0.0, 1.0, -1.0)[digit]
    return signs


def code_of(signs: Vector) -> float:
    """The number that ``signs_of`` reads; exact in a float up to 33 limits."""
    code = 0
    for sign in reversed(signs.tolist()):
        code = 3 * code + (0 if sign == 0.0 else 1 if sign > 0.0 else 2)
    return float(code)


def solved(H: Any, increments: Any, linear: Vector, low: Vector, high: Vector, active: float) -> tuple[Vector, float]:
    """(Moves [n], active limits) of min v'H v / 2 + linear'v, low <= (v, increments v) <= high [2 n].

    ``active`` is where to start from; it changes the work, not the result. Where DAQP finds no
    solution the second value is UNSOLVED.
    """
    start = signs_of(max(active, 0.0), high.size)
    v, _, flag, info = daqp.solve(H, linear, increments, high, low, dual_start=start, primal_tol=ACCURACY)
    if flag != 1:
        return v, UNSOLVED
    multipliers = info["lam"]
    return v, code_of(np.where(np.abs(multipliers) > INACTIVE, multipliers, 0.0))


def first_of(H: Any, increments: Any, linear: Vector, low: Vector, high: Vector, active: float) -> tuple[float, float]:
    """``solved``, the first move alone."""
    v, now = solved(H, increments, linear, low, high, active)
    return float(v[0]), now


@scalar
def held(j: int, forward: float, p: Any) -> float:
    """Torque in N m that move j is seen from.

    An aim beyond the motor does not stay there. Were it to, the plan would count on the limit to
    correct later what can be corrected now.
    """
    limit: float = p.rated_torque
    return forward if j == 0 else min(max(forward, -limit), limit)


@scalar
def unlimited_move(j: int, z_0: float, z_1: float, z_2: float, p: Any) -> float:
    """Move j in N m of the optimum without limits."""
    move: float = p.best[j, 0] * z_0 + p.best[j, 1] * z_1 + p.best[j, 2] * z_2
    return move


@scalar
def keeps_limits(forward: float, last: float, z_0: float, z_1: float, z_2: float, p: Any) -> bool:
    """Whether the optimum without limits keeps all of them; ``last`` is the command before it in N m."""
    for j in range(p.spans.size):
        command = held(j, forward, p) + unlimited_move(j, z_0, z_1, z_2, p)
        if abs(command) > p.rated_torque or abs(command - last) > p.spans[j] * p.slew_rate * p.period:
            return False
        last = command
    return True


@scalar
def limits(forward: float, last: float, p: Any) -> Any:
    """(low [2 n], high [2 n]) in N m for the moves and for their increments."""
    n = p.spans.size
    low, high = np.empty(2 * n), np.empty(2 * n)
    for j in range(n):
        base, bend = held(j, forward, p), p.spans[j] * p.slew_rate * p.period
        low[j], high[j] = -p.rated_torque - base, p.rated_torque - base
        low[n + j], high[n + j] = last - base - bend, last - base + bend
        last = base
    return low, high


@scalar
def next_command(
    forward: float, last: float, z_0: float, z_1: float, z_2: float, active: float, p: Any
) -> tuple[float, float]:
    """(Motor command in N m, active limits) for z = (twist, rate, motor torque), as seen from the aim.

    ``forward`` is what holds the aim and ``last`` the last command, both in N m at the motor.
    """
    # From beyond the rated torque there may be no way back within the slew rate.
    last = min(max(last, -p.rated_torque), p.rated_torque)
    first = unlimited_move(0, z_0, z_1, z_2, p)
    if keeps_limits(forward, last, z_0, z_1, z_2, p):
        return forward + first, 0.0

    low, high = limits(forward, last, p)
    linear = np.empty(p.spans.size)
    for j in range(p.spans.size):
        linear[j] = p.slopes[j, 0] * z_0 + p.slopes[j, 1] * z_1 + p.slopes[j, 2] * z_2
    H, increments = p.H, p.increments
    with objmode(move="float64", now="float64"):
        move, now = first_of(H, increments, linear, low, high, active)
    wanted = first if now < 0.0 else move
    return limited_command(forward + wanted, last, p, p.period), now
