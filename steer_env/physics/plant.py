"""The plant of every environment: steering, motor, frictions and the car behind the rack.

Classical Runge-Kutta for the smooth part. Dahl friction depends on displacement alone, so each
stage takes its exact value at the stage's own displacement; the motor's lag takes its exact value
at the start, middle and end.

``python -m experiments.integrator_study`` measures what a step costs. Without friction the order is
4; a reversal inside a step, of which only the net displacement is seen, makes it 2. Two steps of
0.5 ms in a control period keep the torsion-bar torque within 0.0015 N m (EPAS) and 0.004 N m
(steer-by-wire) of the truth, within 0.004 and 0.023 N m at the stiff ends of their spreads, below
the torque sensor's 0.03 N m; one step misses by up to 0.34 N m there. The longest stable step is
3.1 ms (the front tyre's relaxation at 105 km/h), 2.3 ms for the stiffest steer-by-wire draw. A
torque flange of 15 000 N m/rad would want four steps. With friction frozen over each step two steps
would miss by 0.06 to 0.18 N m (EPAS): exact friction at every stage is what makes them enough.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from steer_env.physics import vehicle
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Driver, Hand, driver_torque
from steer_env.physics.effects import vehicle_ports as ports
from steer_env.physics.effects.acting import (
    FrontAxle,
    bar_torques,
    column_after,
    front_axle,
    pinion_moment,
    scrub_after,
)
from steer_env.physics.friction import dahl_step, lugre_torque, stribeck_level
from steer_env.physics.motor import lag_step
from steer_env.physics.reference import ReferenceParameters, reference_load, single_track_of
from steer_env.physics.steering import Steering, SteeringMotion, moved, steering_rates, steering_rates_with
from steer_env.physics.vehicle import SingleTrackState, rk4_mean


class PlantState(NamedTuple):
    """SI: rad, rad/s, m/s, rad, N m. Friction torques resist positive motion when positive.

    The last two belong to effects of the catalogue and stay zero without them.
    """

    steering_angle: float
    steering_rate: float
    pinion_angle: float
    pinion_rate: float
    lateral_speed: float
    yaw_rate: float
    slip_front: float
    slip_rear: float
    wheel_friction: float
    pinion_friction: float
    motor_torque: float
    rack_friction: float
    column_friction: float


@scalar
def motion_of(x: PlantState) -> SteeringMotion:
    """The four mechanical states."""
    return SteeringMotion(x.steering_angle, x.steering_rate, x.pinion_angle, x.pinion_rate)


@scalar
def track_of(x: PlantState) -> SingleTrackState:
    """The four states of the car."""
    return SingleTrackState(x.lateral_speed, x.yaw_rate, x.slip_front, x.slip_rear)


@scalar
def bristle_torque(torque: float, displacement: float, rate: float, p: Steering, extra: float = 0.0) -> float:
    """Bristle torque of the lower body in N m after a displacement in rad, sliding at ``rate``.

    ``extra`` in N m is added to the level (effects of the catalogue).

    Dahl (Eq. 15), or LuGre where the level at rest is higher: with z = M / c_fric LuGre's bristle obeys the same
    equation with the level of the present rate in place of M_C.
    """
    level = p.M_fric
    if p.M_fric_extra > 0.0:
        level = stribeck_level(rate, p.M_fric, p.M_fric + p.M_fric_extra, p.stribeck_rate)
    return dahl_step(torque, displacement, level + extra, p.c_fric)


@scalar
def bristle_damping(torque: float, rate: float, p: Steering) -> float:
    """LuGre's sigma_1 z' in N m at a bristle torque; zero with Dahl friction."""
    if p.sigma_1 <= 0.0:
        return 0.0
    M_S = p.M_fric + p.M_fric_extra
    both = lugre_torque(torque / p.c_fric, rate, p.M_fric, M_S, p.stribeck_rate, p.c_fric, p.sigma_1)
    return both - torque


@scalar
def axle_with(
    q: SteeringMotion, v: SingleTrackState, rack_friction: float, speed: float, car: ReferenceParameters, row: Any
) -> FrontAxle:
    """The front axle with a row of effects; ``rack_friction`` in N m at the pinion.

    Kinematic slip (Eq. 10) follows from the angle alone, so it is corrected for the angle that effects take away on the
    way to the wheels; relaxed slip has it already.
    """
    per_ratio, force = 1.0 / car.i_s, car.C_f * v.slip_front
    M_plain = reference_load(q.pinion_angle, v, speed, car)
    axle = front_axle(
        q.pinion_angle, q.pinion_rate, speed, v.slip_front, force, M_plain, rack_friction, per_ratio, row
    )
    if car.relaxed > 0.5:
        return axle
    M_tyres = M_plain + vehicle.rack_torque(axle.tyre_angle - q.pinion_angle * per_ratio, single_track_of(car))
    return front_axle(
        q.pinion_angle, q.pinion_rate, speed, v.slip_front, force, M_tyres, rack_friction, per_ratio, row
    )


@scalar
def rack_torque_at(x: PlantState, speed: float, rack_share: float, car: ReferenceParameters, row: Any) -> float:
    """M_rack in N m with which the rack loads the lower body; ``rack_share`` 0: no rack."""
    if row is None:
        return rack_share * reference_load(x.pinion_angle, track_of(x), speed, car)
    return rack_share * axle_with(motion_of(x), track_of(x), x.rack_friction, speed, car, row).M_rack


class Frictions(NamedTuple):
    """Friction torques in N m with memory: wheel, pinion's bristle, and those of the catalogue's effects."""

    wheel: float
    pinion: float
    rack: float
    column: float


@scalar
def frictions_of(x: PlantState) -> Frictions:
    """The frictions as they stand."""
    return Frictions(x.wheel_friction, x.pinion_friction, x.rack_friction, x.column_friction)


@scalar
def frictions_after(start: PlantState, q: SteeringMotion, speed: float, p: Steering, row: Any) -> Frictions:
    """The frictions at ``q`` reached one way from ``start`` (exact)."""
    turned = q.steering_angle - start.steering_angle
    travel = q.pinion_angle - start.pinion_angle
    wheel = dahl_step(start.wheel_friction, turned, p.M_s_fric, p.c_s_fric)
    if row is None:
        return Frictions(wheel, bristle_torque(start.pinion_friction, travel, q.pinion_rate, p), 0.0, 0.0)
    at_pinion = pinion_moment(q.pinion_angle, q.pinion_rate, speed)
    extra = ports.pinion_friction_level(at_pinion, row)
    return Frictions(
        wheel,
        bristle_torque(start.pinion_friction, travel, q.pinion_rate, p, extra),
        scrub_after(start.rack_friction, travel, at_pinion, row),
        column_after(start.column_friction, turned, q.steering_angle, row),
    )


@scalar
def plant_rates(
    q: SteeringMotion,
    v: SingleTrackState,
    frictions: Frictions,
    motor_torque: float,
    hand: Hand,
    speed: float,
    rack_share: float,
    steering: Steering,
    driver: Driver,
    car: ReferenceParameters,
    row: Any = None,
) -> tuple[SteeringMotion, SingleTrackState]:
    """Derivatives at ``q``, ``v``; ``rack_share`` 0: no rack.

    ``row`` holds effects of the catalogue (``vehicle_ports.effect_row``) or is None.
    """
    pinion_friction = frictions.pinion + bristle_damping(frictions.pinion, q.pinion_rate, steering)
    M_s = driver_torque(q.steering_angle, q.steering_rate, hand.angle, hand.rate, hand.torque, hand.grip, driver)
    J_driver = driver.J * hand.grip
    if row is None:
        M_rack = rack_share * reference_load(q.pinion_angle, v, speed, car)
        motion = steering_rates(q, M_s, frictions.wheel, pinion_friction, M_rack, motor_torque, J_driver, steering)
        return motion, vehicle.single_track_rates(v, q.pinion_angle * (1.0 / car.i_s), speed, single_track_of(car))
    axle = axle_with(q, v, frictions.rack, speed, car, row)
    M_tb, M_up = bar_torques(
        q.steering_angle, q.steering_rate, q.pinion_angle, q.pinion_rate, steering.c_tb, steering.b_tb, row
    )
    wheel_friction = frictions.wheel + frictions.column
    at_pinion = pinion_moment(q.pinion_angle, q.pinion_rate, speed)
    M_load = rack_share * axle.M_rack + ports.pinion_torque(at_pinion, row)
    motion = steering_rates_with(
        q, M_tb, M_up, M_s, wheel_friction, pinion_friction, M_load, motor_torque, J_driver, steering
    )
    track = vehicle.single_track_rates(v, axle.tyre_angle, speed, single_track_of(car))
    return motion, SingleTrackState(
        track.lateral_speed + axle.side_acceleration, track.yaw_rate, track.slip_front, track.slip_rear
    )


@scalar
def plant_step(
    x: PlantState,
    motor_target: float,
    decay_half: float,
    hand: Hand,
    speed: float,
    rack_share: float,
    steering: Steering,
    driver: Driver,
    car: ReferenceParameters,
    h: float,
    row: Any = None,
) -> PlantState:
    """State after h seconds with constant motor target (N m), hand and speed.

    ``decay_half`` is what the motor's lag keeps over h/2 seconds.
    """
    M0 = x.motor_torque
    M1 = lag_step(M0, motor_target, decay_half)
    M2 = lag_step(M1, motor_target, decay_half)
    q, v = motion_of(x), track_of(x)
    k0, t0 = plant_rates(q, v, frictions_of(x), M0, hand, speed, rack_share, steering, driver, car, row)
    q1, v1 = moved(q, 0.5 * h, k0), vehicle.moved(v, 0.5 * h, t0)
    f1 = frictions_after(x, q1, speed, steering, row)
    k1, t1 = plant_rates(q1, v1, f1, M1, hand, speed, rack_share, steering, driver, car, row)
    q2, v2 = moved(q, 0.5 * h, k1), vehicle.moved(v, 0.5 * h, t1)
    f2 = frictions_after(x, q2, speed, steering, row)
    k2, t2 = plant_rates(q2, v2, f2, M1, hand, speed, rack_share, steering, driver, car, row)
    q3, v3 = moved(q, h, k2), vehicle.moved(v, h, t2)
    f3 = frictions_after(x, q3, speed, steering, row)
    k3, t3 = plant_rates(q3, v3, f3, M2, hand, speed, rack_share, steering, driver, car, row)
    motion = SteeringMotion(
        q.steering_angle + rk4_mean(k0.steering_angle, k1.steering_angle, k2.steering_angle, k3.steering_angle, h),
        q.steering_rate + rk4_mean(k0.steering_rate, k1.steering_rate, k2.steering_rate, k3.steering_rate, h),
        q.pinion_angle + rk4_mean(k0.pinion_angle, k1.pinion_angle, k2.pinion_angle, k3.pinion_angle, h),
        q.pinion_rate + rk4_mean(k0.pinion_rate, k1.pinion_rate, k2.pinion_rate, k3.pinion_rate, h),
    )
    track = vehicle.moved_rk4(v, t0, t1, t2, t3, h)
    frictions = frictions_after(x, motion, speed, steering, row)
    return PlantState(
        motion.steering_angle,
        motion.steering_rate,
        motion.pinion_angle,
        motion.pinion_rate,
        track.lateral_speed,
        track.yaw_rate,
        track.slip_front,
        track.slip_rear,
        frictions.wheel,
        frictions.pinion,
        M2,
        frictions.rack,
        frictions.column,
    )
