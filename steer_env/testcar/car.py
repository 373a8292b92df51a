"""Equations of the test vehicle: steering, motor and two-track car under constant commands.

Classical Runge-Kutta for what is smooth. Dahl friction takes its exact value at each stage's own
displacement, the motor's lag its exact value in time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects import vehicle_ports as ports
from steer_env.physics.effects.acting import (
    bar_torques,
    column_after,
    front_axle,
    pinion_moment,
    scrub_after,
)
from steer_env.physics.friction import dahl_step
from steer_env.physics.motor import lag_step
from steer_env.physics.steering import Steering, SteeringMotion, moved, steering_rates_with
from steer_env.physics.two_track import TwoTrackState, contact, rack_torque_of, two_track_rates
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.physics.vehicle import rk4_mean


class Mechanics(NamedTuple):
    """Parameters of everything that moves; J_robot in kg m2 sits on the wheel."""

    steering: Steering
    vehicle: TwoTrack
    J_robot: float


class Load(NamedTuple):
    """Acting during one substep: robot and road torque in N m, side wind in N, speed in m/s."""

    robot_torque: float
    road_torque: float
    side_force: float
    speed: float


class CarState(NamedTuple):
    """Motion, car, friction torques and both parts of the motor's torque in N m at the pinion.

    ``rack_friction`` and ``column_friction`` belong to effects of the catalogue and are zero without them.
    """

    motion: SteeringMotion
    track: TwoTrackState
    wheel_friction: float
    pinion_friction: float
    basic: float
    compensation: float
    rack_friction: float
    column_friction: float


class Frictions(NamedTuple):
    """Friction torques in N m: wheel, pinion, and those of effects on the rack's and the column's side."""

    wheel: float
    pinion: float
    rack: float
    column: float


@scalar
def drifted(x: TwoTrackState, h: float, k: TwoTrackState) -> TwoTrackState:
    """Return x + h k."""
    return TwoTrackState(
        x.lateral_speed + h * k.lateral_speed,
        x.yaw_rate + h * k.yaw_rate,
        x.roll + h * k.roll,
        x.roll_rate + h * k.roll_rate,
        x.slip_fl + h * k.slip_fl,
        x.slip_fr + h * k.slip_fr,
        x.slip_rl + h * k.slip_rl,
        x.slip_rr + h * k.slip_rr,
    )


@scalar
def mean_drift(
    k0: TwoTrackState, k1: TwoTrackState, k2: TwoTrackState, k3: TwoTrackState
) -> TwoTrackState:
    """Slope of a classical Runge-Kutta step from its four slopes."""
    return TwoTrackState(
        rk4_mean(k0.lateral_speed, k1.lateral_speed, k2.lateral_speed, k3.lateral_speed, 1.0),
        rk4_mean(k0.yaw_rate, k1.yaw_rate, k2.yaw_rate, k3.yaw_rate, 1.0),
        rk4_mean(k0.roll, k1.roll, k2.roll, k3.roll, 1.0),
        rk4_mean(k0.roll_rate, k1.roll_rate, k2.roll_rate, k3.roll_rate, 1.0),
        rk4_mean(k0.slip_fl, k1.slip_fl, k2.slip_fl, k3.slip_fl, 1.0),
        rk4_mean(k0.slip_fr, k1.slip_fr, k2.slip_fr, k3.slip_fr, 1.0),
        rk4_mean(k0.slip_rl, k1.slip_rl, k2.slip_rl, k3.slip_rl, 1.0),
        rk4_mean(k0.slip_rr, k1.slip_rr, k2.slip_rr, k3.slip_rr, 1.0),
    )


@scalar
def mean_motion(
    k0: SteeringMotion, k1: SteeringMotion, k2: SteeringMotion, k3: SteeringMotion
) -> SteeringMotion:
    """Slope of a classical Runge-Kutta step from its four slopes."""
    return SteeringMotion(
        rk4_mean(k0.steering_angle, k1.steering_angle, k2.steering_angle, k3.steering_angle, 1.0),
        rk4_mean(k0.steering_rate, k1.steering_rate, k2.steering_rate, k3.steering_rate, 1.0),
        rk4_mean(k0.pinion_angle, k1.pinion_angle, k2.pinion_angle, k3.pinion_angle, 1.0),
        rk4_mean(k0.pinion_rate, k1.pinion_rate, k2.pinion_rate, k3.pinion_rate, 1.0),
    )


@scalar
def friction_after(x: CarState, q: SteeringMotion, speed: float, s: Steering, row: Any) -> Frictions:
    """Frictions once the motion has gone one way from ``x`` to ``q``."""
    turned, travel = q.steering_angle - x.motion.steering_angle, q.pinion_angle - x.motion.pinion_angle
    at_pinion = pinion_moment(q.pinion_angle, q.pinion_rate, speed)
    level = s.M_fric + ports.pinion_friction_level(at_pinion, row)
    return Frictions(
        dahl_step(x.wheel_friction, turned, s.M_s_fric, s.c_s_fric),
        dahl_step(x.pinion_friction, travel, level, s.c_fric),
        scrub_after(x.rack_friction, travel, at_pinion, row),
        column_after(x.column_friction, turned, q.steering_angle, row),
    )


@scalar
def track_rates(
    q: SteeringMotion, v: TwoTrackState, rack_friction: float, load: Load, p: TwoTrack, row: Any
) -> tuple[TwoTrackState, float, float, float]:
    """Derivatives, a_y, M_rack (as ``two_track_rates``) behind whatever effects lie between pinion and tyres.

    The last is the rack force over i_rp in N m, as strain gauges have it.
    """
    per_ratio = 1.0 / p.i_s
    plain_angle = q.pinion_angle * per_ratio
    if row is None:
        rates, a_y, M_rack = two_track_rates(v, plain_angle, load.speed, load.side_force, p)
        return rates, a_y, M_rack, M_rack
    c = contact(v, plain_angle, p)
    force, slip = c.force_fl + c.force_fr, 0.5 * (v.slip_fl + v.slip_fr)
    torque = rack_torque_of(c, plain_angle, p)
    axle = front_axle(q.pinion_angle, q.pinion_rate, load.speed, slip, force, torque, rack_friction, per_ratio, row)
    rates, a_y, _ = two_track_rates(v, axle.tyre_angle, load.speed, load.side_force, p)
    return pulled(rates, axle.side_acceleration), a_y, axle.M_rack, axle.M_sensed


@scalar
def car_rates(
    x: CarState, q: SteeringMotion, v: TwoTrackState, motor_torque: float, load: Load, p: Mechanics, row: Any
) -> tuple[SteeringMotion, TwoTrackState]:
    """Derivatives at ``q`` and ``v`` reached from ``x``; ``motor_torque`` in N m at the pinion."""
    friction = friction_after(x, q, load.speed, p.steering, row)
    rates, _, M_rack, _ = track_rates(q, v, friction.rack, load, p.vehicle, row)
    shaft = motor_torque / p.steering.motor_ratio
    at_pinion = pinion_moment(q.pinion_angle, q.pinion_rate, load.speed)
    M_load = M_rack + load.road_torque + ports.pinion_torque(at_pinion, row)
    M_tb, M_up = bar_torques(
        q.steering_angle, q.steering_rate, q.pinion_angle, q.pinion_rate, p.steering.c_tb, p.steering.b_tb, row
    )
    motion = steering_rates_with(
        q, M_tb, M_up, load.robot_torque, friction.wheel + friction.column, friction.pinion, M_load, shaft, p.J_robot,
        p.steering,
    )  # fmt: skip
    return motion, rates


@scalar
def pulled(k: TwoTrackState, acceleration: float) -> TwoTrackState:
    """Derivatives of a body that is also pulled aside, in m/s2."""
    return TwoTrackState(
        k.lateral_speed + acceleration, k.yaw_rate, k.roll, k.roll_rate, k.slip_fl, k.slip_fr, k.slip_rl, k.slip_rr
    )


@scalar
def car_step(
    x: CarState,
    basic: float,
    compensation: float,
    decay_half: float,
    load: Load,
    p: Mechanics,
    h: float,
    row: Any,
) -> CarState:
    """State after h seconds under constant motor commands in N m at the pinion.

    ``decay_half`` is what the motor's lag keeps over h/2; ``row`` holds the effects of the catalogue, or is None.
    """
    basic_1 = lag_step(x.basic, basic, decay_half)
    basic_2 = lag_step(basic_1, basic, decay_half)
    compensation_1 = lag_step(x.compensation, compensation, decay_half)
    compensation_2 = lag_step(compensation_1, compensation, decay_half)
    M0, M1, M2 = x.basic + x.compensation, basic_1 + compensation_1, basic_2 + compensation_2
    q, v = x.motion, x.track
    k0, t0 = car_rates(x, q, v, M0, load, p, row)
    k1, t1 = car_rates(x, moved(q, 0.5 * h, k0), drifted(v, 0.5 * h, t0), M1, load, p, row)
    k2, t2 = car_rates(x, moved(q, 0.5 * h, k1), drifted(v, 0.5 * h, t1), M1, load, p, row)
    k3, t3 = car_rates(x, moved(q, h, k2), drifted(v, h, t2), M2, load, p, row)
    motion = moved(q, h, mean_motion(k0, k1, k2, k3))
    friction = friction_after(x, motion, load.speed, p.steering, row)
    return CarState(
        motion,
        drifted(v, h, mean_drift(t0, t1, t2, t3)),
        friction.wheel,
        friction.pinion,
        basic_2,
        compensation_2,
        friction.rack,
        friction.column,
    )


@scalar
def car_at_rest() -> CarState:
    """Straight ahead, nothing moving but the car."""
    return CarState(
        SteeringMotion(0.0, 0.0, 0.0, 0.0),
        TwoTrackState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
