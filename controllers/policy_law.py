"""A learned policy: a small network that gives the motor torque, or a correction of a classical law's.

    torque = base law's command + relief * share * authority * smooth(action),   action = network(signals) in [-1, 1]

The base law runs in every period; the network acts every ``decimation`` periods. Its action is held between,
then a first-order lag smooths the steps and, where the torsion bar's mode is too fast to be damped, the
same notch as in the other laws keeps them off it: without both, what a learner tries out shakes the wheel.
In admittance the loop's gain grows with the slope of the assist: beyond ``slope_limit`` the action acts in
inverse proportion to it (relief), so that what was learned on centre does not shake where the assist is steep.
``share`` of the speed is what was left to the policy after training, so that its loops are stable (1 in training).
``experiments.train`` trains it in exactly this arrangement, with the functions below.

Signals are divided by what they are worth in the training domain, cut at SIGNAL_LIMIT, and given once as
they are and once times the speed's deviation from its mean:

    h = tanh(s W_1 + s v W_2),   h' = tanh(h W_3),   action = h' w

so that weights are straight in speed, and without any offset: a left turn is a right turn, and at rest
nothing is commanded, whatever was learned.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from controllers.blocks import Notch, NotchState, assist_slope, notch_step
from controllers.schedule import Schedule, felt_at
from steer_env.interface import Law, Observation
from steer_env.physics._jit import compiled, named, scalar
from steer_env.physics.rows import place
from steer_env.units import Quantity

SIGNAL_LIMIT = 10.0  # times a signal's scale


class Signals(NamedTuple):
    """What the network sees, SI; the speed comes beside it.

    ``error`` is reference minus torsion-bar torque (N m) or pinion angle (rad), ``error_change`` that
    since the network's last step, ``error_sum`` a sum over those steps that leaks; ``command`` is the base
    law's torque in N m; ``action_1`` to ``_4`` are the network's own last actions, newest first.
    """

    error: float
    pinion_angle: float
    pinion_rate: float
    pinion_acceleration: float
    torsion_bar_torque: float
    reference: float
    reference_rate: float
    reference_acceleration: float
    effective_torque: float
    last_torque_1: float
    error_change: float
    error_sum: float
    command: float
    action_1: float
    action_2: float
    action_3: float
    action_4: float


class Memory(NamedTuple):
    """The network's last actions, newest first (the first is held), the error, and the smoothed action."""

    action_1: float = 0.0
    action_2: float = 0.0
    action_3: float = 0.0
    action_4: float = 0.0
    error: float = 0.0
    error_sum: float = 0.0
    smooth: float = 0.0
    z1: float = 0.0
    z2: float = 0.0


class PolicyParameters(NamedTuple):
    """Base law's parameters, network, and how its action acts."""

    base: Any  # parameters of the base law
    gains: Any  # float64 [17], one over the scale of each signal, 0 for one that is not shown
    first: Any  # float64 [34, n]: W_1 over W_2
    second: Any  # float64 [n, m]: W_3
    last: Any  # float64 [m]: w
    authority: Annotated[float, Quantity("N m", "torque of an action of 1, at the motor", 0.0, 50.0, "training")]
    decimation: Annotated[float, Quantity("periods", "from one step of the network to the next", 1, 100, "training")]
    admittance: Annotated[float, Quantity("-", "1 admittance, 0 impedance", 0, 1, "the loop's own")]
    squashed: Annotated[float, Quantity("-", "1 tanh of the network's output, 0 cut at +-1", 0, 1, "training")]
    keep: Annotated[float, Quantity("-", "what error_sum keeps over a step", 0.0, 1.0, "training")]
    mean_speed: Annotated[float, Quantity("m/s", "taken from the speed", 0.0, 120.0, "training")]
    speed_scale: Annotated[float, Quantity("m/s", "and this divides the rest", 0.1, 120.0, "training")]
    shares: Any  # float64 [n, 2]: speed in m/s, share of the authority there
    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    slope_limit: Annotated[float, Quantity("-", "assist slope beyond which it yields", 0.1, 1e6, "training")]
    lag: Annotated[float, Quantity("-", "what the smoothing keeps over a period", 0.0, 1.0, "training")]
    notch: Notch = Notch()


class PolicyState(NamedTuple):
    """Base law's state, periods since the network acted, and its memory."""

    base: Any
    tick: float = 0.0
    memory: Memory = Memory()


@scalar
def signals_of(o: Observation, command: float, m: Memory, p: Any) -> Signals:
    """What the network sees; ``command`` in N m is the base law's for this period."""
    error = o.reference - (o.pinion_angle if p.admittance > 0.5 else o.torsion_bar_torque)
    return Signals(
        error,
        o.pinion_angle,
        o.pinion_rate,
        o.pinion_acceleration,
        o.torsion_bar_torque,
        o.reference,
        o.reference_rate,
        o.reference_acceleration,
        o.effective_torque,
        o.last_torque_1,
        error - m.error,
        p.keep * m.error_sum + error,
        command,
        m.action_1,
        m.action_2,
        m.action_3,
        m.action_4,
    )


@scalar
def remembered(m: Memory, signals: Signals, action: float) -> Memory:
    """The memory after the network's step: ``action`` is the one that is held from now on."""
    return Memory(
        action, m.action_1, m.action_2, m.action_3, signals.error, signals.error_sum, m.smooth, m.z1, m.z2
    )


@scalar
def smoothed(m: Memory, p: Any) -> tuple[float, Memory]:
    """(The held action after lag and notch, memory) one control period on."""
    smooth = m.action_1 + p.lag * (m.smooth - m.action_1)
    value, notched = notch_step(smooth, NotchState(m.z1, m.z2), p.notch)
    return value, Memory(
        m.action_1, m.action_2, m.action_3, m.action_4, m.error, m.error_sum, smooth, notched.z1, notched.z2
    )


@scalar
def share_at(speed: float, shares: Any) -> float:
    """Share of the authority at a speed in m/s, straight between the rows of ``shares``."""
    low, high, along = place(speed, shares)
    value: float = shares[low, 1] + along * (shares[high, 1] - shares[low, 1])
    return value


@scalar
def relief(o: Observation, p: Any) -> float:
    """Share of the action that acts: less where the assist is steep, in admittance."""
    if p.admittance < 0.5:
        return 1.0
    return min(p.slope_limit / assist_slope(o.torsion_bar_torque, felt_at(o.speed, p.schedule)), 1.0)


def lag_of(bandwidth_Hz: float, period: float) -> float:
    """What a first-order lag keeps over a period in s; 0 Hz: no lag at all."""
    return math.exp(-2.0 * math.pi * bandwidth_Hz * period) if bandwidth_Hz > 0.0 else 0.0


@compiled
def network(signals: Signals, speed: float, gains: Any, first: Any, second: Any, last: Any) -> float:
    """Output of the network for signals and the speed's deviation in scales; sums run in the order written."""
    n, m, count = second.shape[0], second.shape[1], gains.size
    sums = np.zeros(n)
    for k in range(count):
        share = min(max(signals[k] * gains[k], -SIGNAL_LIMIT), SIGNAL_LIMIT)
        timed = share * speed
        for j in range(n):
            sums[j] += share * first[k, j] + timed * first[count + k, j]
    more = np.zeros(m)
    for k in range(n):
        hidden = math.tanh(sums[k])
        for j in range(m):
            more[j] += hidden * second[k, j]
    output = 0.0
    for k in range(m):
        output += math.tanh(more[k]) * last[k]
    return output


@scalar
def action_of(signals: Signals, speed: float, p: PolicyParameters) -> float:
    """The network's action in [-1, 1]; ``speed`` in m/s."""
    deviation = (speed - p.mean_speed) / p.speed_scale
    output = network(signals, deviation, p.gains, p.first, p.second, p.last)
    return math.tanh(output) if p.squashed > 0.5 else min(max(output, -1.0), 1.0)


@scalar
def silent_law(o: Observation, x: Any, p: Any) -> tuple[float, Any]:
    """The base of a policy that gives the whole torque: nothing."""
    return 0.0, x


@cache
def corrected(base: Law) -> Law:
    """A law whose command a network corrects."""

    def law(o: Observation, x: PolicyState, p: PolicyParameters) -> tuple[float, PolicyState]:
        command, state = base(o, x.base, p.base)
        memory = x.memory
        if x.tick < 0.5:
            signals = signals_of(o, command, memory, p)
            memory = remembered(memory, signals, action_of(signals, o.speed, p))
        tick = x.tick + 1.0
        if tick > p.decimation - 0.5:
            tick = 0.0
        action, memory = smoothed(memory, p)
        worth = relief(o, p) * share_at(o.speed, p.shares) * p.authority
        return command + worth * action, PolicyState(state, tick, memory)

    return scalar(named(law, base.__module__, base))
