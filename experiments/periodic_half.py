"""Linear halves that repeat themselves only every N periods, as a policy's at 200 Hz in a loop at 1 kHz.

One period of such a law is not like the next: its half is a tuple of N halves, one for each period of a step (one
alone for every other law, and then nothing here differs from experiments.linear_loop).

Modes are those of one whole step (Floquet): the matrices of its periods, multiplied in order, carry the loop from step
to step; exact. A response is that at the driving frequency itself, the mean over a step of what answers exp(j w t). The
images at multiples of the step's rate above and below it are left out: they are small where it is far below half the
step's rate, and as large as the answer near there. So margins are not read off it (experiments.periodic_margins).
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from experiments.linear_loop import AT_REST, Array, Complexes, Half, closed_loop, modes, response
from steer_env.envs.layout import PERIOD

Halves = tuple[Half, ...]


def closed_loops(environment: Half, law: Halves, gain: complex = 1.0) -> Halves:
    """The loop in each period of a step; as ``linear_loop.closed_loop``."""
    return tuple(closed_loop(environment, half, gain) for half in law)


def step_modes(loops: Halves) -> list[Complexes]:
    """Modes of each loop [m] in rad/s, fastest growing first; frequencies beyond half the step's rate fold."""
    first, count = loops[0], len(loops)
    if count == 1:
        return modes(first)
    found = []
    for rates in modes(Half(carried(loops), first.B, first.C, first.D)):
        slower = rates / count
        found.append(slower[np.abs(slower) > AT_REST])
    return found


def carried(halves: Halves) -> Array:
    """What takes the states over a whole step."""
    matrix: Array = reduce(lambda before, half: half.A @ before, halves[1:], halves[0].A)
    return matrix


def step_response(halves: Halves, omega: Array) -> Complexes:
    """Response [f, outputs, inputs] at omega [f] in rad/s, at the driving frequency alone.

    With x = exp(j w t) p in period k, p_{k+1} z = A_k p_k + B_k, and p comes back to itself after a step.
    """
    if len(halves) == 1:
        return response(halves[0], omega)
    z = np.exp(1j * omega * PERIOD)[:, None, None]
    moved = np.zeros((omega.size, *halves[0].B.shape), dtype=complex)
    for half in halves:
        moved = (half.A @ moved + half.B) / z
    over = carried(halves) / z ** len(halves)
    p = np.linalg.solve(np.eye(len(halves[0].A)) - over, moved)
    total = np.zeros((), dtype=complex)
    for half in halves:
        total = total + half.C @ p + half.D
        p = (half.A @ p + half.B) / z
    return np.asarray(total / len(halves), dtype=complex)
