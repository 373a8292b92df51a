"""What an effect may depend on in a vehicle's steering, at one instant."""

from __future__ import annotations

from typing import NamedTuple

from steer_env.physics._jit import scalar


class Moment(NamedTuple):
    """SI: rad, rad/s, N m, N, m/s. Fields that are not known yet where a port is asked are zero.

    ``twist`` is the angle over the torsion bar and ``bar_stiffness`` its c_tb; ``assist_torque`` is what the basic
    assist adds to the torsion-bar torque; ``rack_torque`` is the tyres' share of M_rack at the pinion.
    """

    steering_angle: float
    pinion_angle: float
    pinion_rate: float
    twist: float
    bar_stiffness: float
    torsion_bar_torque: float
    assist_torque: float
    speed: float
    front_slip: float
    front_force: float
    rack_torque: float


@scalar
def at_wheel(steering_angle: float) -> Moment:
    """What is known above the torsion bar."""
    return Moment(steering_angle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@scalar
def at_bar(twist: float, bar_stiffness: float) -> Moment:
    """What is known at the torsion bar."""
    return Moment(0.0, 0.0, 0.0, twist, bar_stiffness, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@scalar
def at_assist(torsion_bar_torque: float, assist_torque: float) -> Moment:
    """What is known at the basic assist."""
    return Moment(0.0, 0.0, 0.0, 0.0, 0.0, torsion_bar_torque, assist_torque, 0.0, 0.0, 0.0, 0.0)


@scalar
def at_rack(
    pinion_angle: float, pinion_rate: float, speed: float, front_slip: float, front_force: float, rack_torque: float
) -> Moment:
    """What is known at pinion, rack and front axle."""
    return Moment(0.0, pinion_angle, pinion_rate, 0.0, 0.0, 0.0, 0.0, speed, front_slip, front_force, rack_torque)
