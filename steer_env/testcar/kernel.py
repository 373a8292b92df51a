"""One run of the test vehicle as one compiled loop: robot, control unit, motor, steering and car.

Robot and control unit work once per PERIOD; the mechanics take SUBSTEPS steps in between.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.physics._jit import compiled, scalar
from steer_env.physics.boost_map import ControlLaw, ControlState, control_step, law_at
from steer_env.physics.effects.acting import bar_torques, given_by_assist, seen_by_assist
from steer_env.physics.motor import Motor, lag_decay, lag_step, limited_command
from steer_env.physics.sensors import measured
from steer_env.testcar.car import (
    CarState,
    Load,
    Mechanics,
    car_at_rest,
    car_step,
    track_rates,
)
from steer_env.testcar.parameters import Robot, UnitSensors, VirtualCar

PERIOD = 1e-3  # s, robot and control unit
SUBSTEPS = 2
LONGEST_DEAD_TIME = 16  # periods

# Columns of a record, SI; rack, friction and motor torques act at the pinion.
RECORD = (
    "steering_angle",
    "steering_rate",
    "pinion_angle",
    "pinion_rate",
    "steering_torque",
    "torsion_bar_torque",
    "basic_assist",
    "compensation",
    "pinion_friction",
    "rack_torque",
    "lateral_speed",
    "yaw_rate",
    "lateral_acceleration",
    "roll",
)

Array = NDArray[np.floating]


class Machine(NamedTuple):
    """All parameters of one run at one speed."""

    mechanics: Mechanics
    law: ControlLaw
    motor: Motor
    robot: Robot
    sensors: UnitSensors


def machine_at(speed: float, car: VirtualCar) -> Machine:
    """What the test car is at a speed in m/s."""
    mechanics = Mechanics(car.steering, car.vehicle, car.robot.J)
    return Machine(mechanics, law_at(speed, car.calibration), car.motor, car.robot, car.sensors)


@scalar
def servo_torque(target: float, target_rate: float, angle: float, rate: float, p: Robot) -> float:
    """Torque in N m of the robot's servo: proportional, derivative, target rate fed forward."""
    omega = 2.0 * math.pi * p.bandwidth_Hz
    torque = (
        (p.J + p.wheel_J)
        * omega
        * (omega * (target - angle) + 2.0 * p.damping * (target_rate - rate))
    )
    return min(max(torque, -p.torque_limit), p.torque_limit)


@scalar
def record_row(record: Array, x: CarState, robot_torque: float, load: Load, p: Mechanics, row: Any) -> float:
    """Write one row of RECORD; returns the torsion-bar torque in N m."""
    q = x.motion
    _, a_y, _, M_sensed = track_rates(q, x.track, x.rack_friction, load, p.vehicle, row)
    M_tb, _ = bar_torques(
        q.steering_angle, q.steering_rate, q.pinion_angle, q.pinion_rate, p.steering.c_tb, p.steering.b_tb, row
    )
    record[0], record[1] = q.steering_angle, q.steering_rate
    record[2], record[3] = q.pinion_angle, q.pinion_rate
    record[4], record[5] = robot_torque, M_tb
    record[6], record[7], record[8] = x.basic, x.compensation, x.pinion_friction
    record[9] = M_sensed + load.road_torque
    record[10], record[11], record[12], record[13] = x.track.lateral_speed, x.track.yaw_rate, a_y, x.track.roll
    return M_tb


@scalar
def unit_period(
    k: int,
    M_tb: float,
    pinion_angle: float,
    unit: ControlState,
    last: float,
    lines: Array,
    p: Machine,
    row: Any,
) -> tuple[float, float, ControlState, float]:
    """Period ``k`` of the control unit: (basic assist, compensation) due now, new state, command.

    Both torques in N m at the pinion and before the motor's lag; ``lines`` [2, LONGEST_DEAD_TIME]
    is the dead time.
    """
    ratio = p.mechanics.steering.motor_ratio
    torque = seen_by_assist(measured(M_tb, p.sensors.torque_step, 0.0, 0.0), row)
    angle = measured(pinion_angle, p.sensors.angle_step, 0.0, 0.0)
    basic, compensation, unit = control_step(unit, torque, angle, p.law, PERIOD)
    basic = given_by_assist(torque, basic, row)
    last = limited_command((basic + compensation) / ratio, last, p.motor, PERIOD)
    lines[0, k % LONGEST_DEAD_TIME] = basic
    lines[1, k % LONGEST_DEAD_TIME] = last * ratio - basic
    due = (k - int(p.motor.dead_time)) % LONGEST_DEAD_TIME
    return lines[0, due], lines[1, due], unit, last


@compiled
def rollout(
    target: Array,
    target_rate: Array,
    road_torque: Array,
    side_force: Array,
    speed: float,
    p: Machine,
    row: Any = None,
) -> Array:
    """Record [n, len(RECORD)] of one run at PERIOD.

    ``target`` in rad and ``target_rate`` in rad/s [n] are what the robot is asked for,
    ``road_torque`` in N m at the pinion and ``side_force`` in N [n] are disturbances, ``speed`` in
    m/s is held; ``row`` holds effects of the catalogue (``vehicle_ports.effect_row``).
    """
    n = target.size
    record = np.zeros((n, len(RECORD)))
    lines = np.zeros((2, LONGEST_DEAD_TIME))
    h = PERIOD / SUBSTEPS
    decay_half = lag_decay(p.motor.bandwidth_Hz, 0.5 * h)
    x = car_at_rest()
    unit, last = ControlState(0.0, 0.0, 0.0, 0.0, 0.0), 0.0
    for k in range(n):
        q = x.motion
        robot_torque = servo_torque(
            target[k], target_rate[k], q.steering_angle, q.steering_rate, p.robot
        )
        load = Load(robot_torque, road_torque[k], side_force[k], speed)
        M_tb = record_row(record[k], x, robot_torque, load, p.mechanics, row)
        basic, compensation, unit, last = unit_period(k, M_tb, q.pinion_angle, unit, last, lines, p, row)
        for _ in range(SUBSTEPS):
            x = car_step(x, basic, compensation, decay_half, load, p.mechanics, h, row)
    return record


@compiled
def unit_rollout(M_tb: Array, pinion_angle: Array, p: Machine) -> Array:
    """Delivered basic assist and compensation [n, 2] in N m at the pinion.

    For torsion-bar torque in N m and pinion angle in rad, each [n] at PERIOD.
    """
    n = M_tb.size
    record = np.zeros((n, 2))
    lines = np.zeros((2, LONGEST_DEAD_TIME))
    decay = lag_decay(p.motor.bandwidth_Hz, PERIOD)
    unit, last, basic_now, compensation_now = ControlState(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
    for k in range(n):
        record[k, 0], record[k, 1] = basic_now, compensation_now
        basic, compensation, unit, last = unit_period(
            k, M_tb[k], pinion_angle[k], unit, last, lines, p, None
        )
        basic_now = lag_step(basic_now, basic, decay)
        compensation_now = lag_step(compensation_now, compensation, decay)
    return record
