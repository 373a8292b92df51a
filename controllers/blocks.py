"""Small blocks that laws share: the assist of a Felt reference, a lag, a notch, a past command."""

from __future__ import annotations

import math
from typing import NamedTuple

from controllers.schedule import Felt
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.assist import assist, incremental_assist, inverse_assist
from steer_env.physics.elementary import exponential


class Notch(NamedTuple):
    """(n0 + n1 z^-1 + n2 z^-2) / (1 + d1 z^-1 + d2 z^-2); the default lets everything through."""

    n0: float = 1.0
    n1: float = 0.0
    n2: float = 0.0
    d1: float = 0.0
    d2: float = 0.0


class NotchState(NamedTuple):
    """Memory of the notch (transposed direct form II)."""

    z1: float = 0.0
    z2: float = 0.0


def notch(frequency: float, depth: float, width: float, period: float) -> Notch:
    """(s^2 + 2 depth w s + w^2) / (s^2 + 2 width w s + w^2), bilinear, w = ``frequency`` rad/s."""
    k = frequency / math.tan(0.5 * frequency * period)
    w2, k2 = frequency * frequency, k * k
    first = 1.0 / (k2 + 2.0 * width * frequency * k + w2)
    return Notch(
        (k2 + 2.0 * depth * frequency * k + w2) * first,
        2.0 * (w2 - k2) * first,
        (k2 - 2.0 * depth * frequency * k + w2) * first,
        2.0 * (w2 - k2) * first,
        (k2 - 2.0 * width * frequency * k + w2) * first,
    )


@scalar
def notch_step(u: float, x: NotchState, p: Notch) -> tuple[float, NotchState]:
    """(output, new state) for one sample."""
    y = p.n0 * u + x.z1
    return y, NotchState(p.n1 * u - p.d1 * y + x.z2, p.n2 * u - p.d2 * y)


@scalar
def low_pass(value: float, target: float, bandwidth: float, period: float) -> float:
    """First-order lag of ``bandwidth`` rad/s after one period."""
    return target + (value - target) * exponential(-bandwidth * period)


@scalar
def assisted(M_tb: float, felt: Felt) -> float:
    """M_eff in N m of a torsion-bar torque (Eq. 14, or linearised)."""
    if felt.linear > 0.5:
        return (1.0 + felt.k_gain) * M_tb
    return assist(M_tb, felt.r, felt.sigma)


@scalar
def torque_of(M_eff: float, felt: Felt) -> float:
    """M_tb in N m whose assist is M_eff."""
    if felt.linear > 0.5:
        return M_eff * (1.0 / (1.0 + felt.k_gain))
    return inverse_assist(M_eff, felt.r, felt.sigma)


@scalar
def assist_slope(M_tb: float, felt: Felt) -> float:
    """dM_eff / dM_tb: the gain that a loop through the assist sees."""
    if felt.linear > 0.5:
        return 1.0 + felt.k_gain
    return incremental_assist(M_tb, felt.r, felt.sigma)


@scalar
def aged_command(o: Observation, age: float) -> float:
    """The command in N m given ``age`` periods ago (1 to 4)."""
    if age < 1.5:
        return o.last_torque_1
    if age < 2.5:
        return o.last_torque_2
    return o.last_torque_3 if age < 3.5 else o.last_torque_4
