"""The torsion bar's twist ahead of the delay, seen from what the target wants: what lqg and mpc regulate.

``p`` is the record of the law that calls; besides the fields of controllers.kalman it has
periods_ahead, motor_ratio, c_tb, rate_share, target_bandwidth and period.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from controllers.blocks import aged_command, low_pass
from controllers.kalman import Estimate, carried_on, corrected
from controllers.tracking import Target
from steer_env.interface import Observation
from steer_env.physics._jit import scalar


class Deviation(NamedTuple):
    """Motor torque that holds the target (N m); twist (rad), its rate (rad/s) and motor torque (N m) from there.

    ``slow`` is the lagged signal in N m that the target's rate comes from.
    """

    forward: float
    twist: float
    twist_rate: float
    motor_torque: float
    slow: float


@scalar
def estimated(o: Observation, x: Estimate, known: float, p: Any) -> tuple[Estimate, Estimate]:
    """Estimates at the time of the sensors and when the next command acts; ``known`` load in N m at the sensors."""
    ahead = int(p.periods_ahead)
    seen = carried_on(x, aged_command(o, ahead + 1), known, p)
    # The control unit reports its own estimate of the angle; it is that of the sensor within its noise.
    seen = corrected(seen, o.torsion_bar_torque, o.pinion_angle, p)
    then = seen
    for k in range(ahead):
        then = carried_on(then, aged_command(o, ahead - k), known, p)
    return seen, then


@scalar
def deviation(
    target: Target, signal: float, lagged: float, slow: float, seen: Estimate, then: Estimate, p: Any
) -> Deviation:
    """Where the plant will be, seen from the target; its rate is that of ``signal``, lagged by that share."""
    slow = low_pass(slow, signal, p.target_bandwidth, p.period)
    wanted = target.wanted - lagged * (signal - slow)
    wanted_rate = p.rate_share * p.target_bandwidth * (signal - slow)
    forward = (target.model + target.known + seen.load - wanted) / p.motor_ratio
    twist = then.steering_angle - then.pinion_angle - wanted / p.c_tb
    twist_rate = then.steering_rate - then.pinion_rate - wanted_rate / p.c_tb
    return Deviation(forward, twist, twist_rate, then.motor_torque - forward, slow)
