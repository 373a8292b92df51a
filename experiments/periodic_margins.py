"""Margins of a loop that repeats itself only every few periods, from the modes of a whole step (Floquet).

The response at the driving frequency is not all that comes back to it there: near half the step's rate the images of a
held action are as large as it is, and a margin read off that response may be anything. So here what the margins are
about is done to the loop (experiments.margins says what each is), and its modes say when it begins to grow.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence

import numpy as np

from experiments.linear_loop import Half
from experiments.margins import DELAY_LIMIT, GAIN_LIMIT_dB, Margins
from experiments.periodic_half import Halves, closed_loops, step_modes
from steer_env.envs.layout import PERIOD

GAINS_dB = (0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 28.0, GAIN_LIMIT_dB)  # looked at in turn
TURNS_deg = (1.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 90.0, 130.0, 180.0)
AROUND = np.linspace(0.0, math.pi, 21)  # where the rim of a disk is looked at; its other half is the mirror image
HALVINGS = 8


def step_margins(environment: Half, law: Halves) -> Margins:
    """Margins of a stable loop of the environment of one arm [1, ...] and a law."""

    def grows(factor: complex, late: float = 0.0) -> bool:
        surroundings = delayed_by(environment, late) if late else environment
        # A complex factor's modes have no mirror images: those of the other factor are them.
        factors = {factor, factor.conjugate()} if factor.imag else {factor.real}
        loops = (closed_loops(surroundings, law, f) for f in factors)
        return any(rates[0].real >= 0.0 for loop in loops for rates in step_modes(loop) if rates.size)

    gain = min(
        _first(lambda dB: grows(complex(10.0 ** (sign * dB / 20.0))), GAINS_dB) for sign in (1.0, -1.0)  # noqa: B023
    )
    turn = _first(lambda degrees: grows(cmath.exp(1j * math.radians(degrees))), TURNS_deg)
    most = min(_disk_of_gain(gain), 2.0 * math.tan(0.5 * math.radians(min(turn, 90.0))), 2.0)
    disk = _first(
        lambda alpha: any(grows((2.0 + alpha * d) / (2.0 - alpha * d)) for d in np.exp(1j * AROUND[1:-1])),
        np.array([0.25, 0.5, 0.75, 0.99]) * most,
    )
    delays = PERIOD * np.arange(1.0, round(DELAY_LIMIT / PERIOD) + 1.0)
    late = _first(lambda seconds: grows(1.0 + 0.0j, seconds / PERIOD), delays)
    return Margins(gain, turn, disk if disk < 0.99 * most else most, 1e3 * late)


def delayed_by(environment: Half, periods: float) -> Half:
    """Environments [m] whose motor hears its target later; between whole periods it hears of both in proportion."""
    whole = math.floor(periods)
    share = periods - whole
    states = whole + (share > 0.0)  # targets of the last periods, the latest first
    weights = np.zeros(states + 1)
    weights[whole] = 1.0 - share
    if share > 0.0:
        weights[whole + 1] = share
    A, B, C, D = environment
    m, n, inputs = B.shape
    moved = np.zeros((states, states))
    moved[np.arange(1, states), np.arange(states - 1)] = 1.0
    below = np.broadcast_to(np.concatenate([np.zeros((states, n)), moved], axis=1), (m, states, n + states))
    entered = np.zeros((m, states, inputs))
    entered[:, 0, 0] = 1.0
    heard = np.concatenate([weights[:1], np.ones(inputs - 1)])
    return Half(
        np.concatenate([np.concatenate([A, B[:, :, :1] * weights[1:]], axis=2), below], axis=1),
        np.concatenate([B * heard, entered], axis=1),
        np.concatenate([C, D[:, :, :1] * weights[1:]], axis=2),
        D * heard,
    )


def _first(grows: Callable[[float], bool], values: Sequence[float] | np.ndarray) -> float:
    """Where growth begins on the way through rising ``values``; the last of them where it does not."""
    inside = 0.0
    for value in values:
        if grows(float(value)):
            outside = float(value)
            for _ in range(HALVINGS):
                middle = 0.5 * (inside + outside)
                inside, outside = (inside, middle) if grows(middle) else (middle, outside)
            return 0.5 * (inside + outside)
        inside = float(value)
    return inside


def _disk_of_gain(dB: float) -> float:
    """The disk margin that a gain margin alone would allow."""
    factor = 10.0 ** (dB / 20.0)
    return 2.0 * (factor - 1.0) / (factor + 1.0)
