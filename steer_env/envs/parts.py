"""The parts of a control period, each a function of numbers: command, plant, sensors, ideal, reward."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from steer_env.envs.layout import (
    PARAMETERS,
    PERIOD,
    STATE,
    SUBSTEPS,
    Episode,
    Reward,
    Truth,
)
from steer_env.physics import plant
from steer_env.physics._jit import named, scalar, seldom
from steer_env.physics.driver import Driver, Hand, driver_torque
from steer_env.physics.effects.acting import bar_torques
from steer_env.physics.motor import Motor, lag_decay
from steer_env.physics.plant import PlantState, plant_step
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    TrackMap,
    admittance_step,
    impedance_step,
    single_track_of,
    track_map_column,
)
from steer_env.physics.rows import place
from steer_env.physics.sensors import Sensors, measured
from steer_env.physics.steering import Steering
from steer_env.physics.vehicle import lateral_acceleration

RATE_LIMIT = 40.0  # rad/s: twice what a steering robot does, so the wheel has been thrown
# N m through the elastic element: four times a strong driver, the most a robot gives
TORQUE_LIMIT = 60.0
PART_LIMIT = 10.0  # no part of the reward costs more than this in one period
N_REFERENCE = len(ReferenceParameters._fields)
REFERENCE, CAR = STATE["reference"].start, STATE["car"].start
CAR_M, CAR_J_Z = STATE.column("car", "m"), STATE.column("car", "J_z")
CAR_C_F, CAR_C_R = STATE.column("car", "C_f"), STATE.column("car", "C_r")
CAR_N_T = STATE.column("car", "n_t")
TRACK = STATE["track"].start

_car_spread = PARAMETERS.loader("car_spread")
_reference = STATE.loader("reference")


PlantSteps = Callable[..., PlantState]


def _written_out(n: int) -> PlantSteps:
    """``n`` plant steps one after the other, without a loop: one inside would keep lanes from becoming vector code."""
    if n == 1:
        return plant_step
    fewer = _written_out(n - 1)

    def steps(
        x: PlantState, target: float, decay: float, hand: Hand, speed: float, rack_share: float, steering: Steering,
        driver: Driver, car: ReferenceParameters, h: float, effects: Any,
    ) -> PlantState:  # fmt: skip
        x = fewer(x, target, decay, hand, speed, rack_share, steering, driver, car, h, effects)
        return plant_step(x, target, decay, hand, speed, rack_share, steering, driver, car, h, effects)

    return scalar(named(steps, n))


plant_steps = _written_out(SUBSTEPS)


@scalar
def _row_at(speed: float, table: Any, s_row: Any, start: int) -> None:
    """Write the parameters at a speed in m/s from a table [n, 1 + n_fields] to s_row[start:].

    Straight between the table's rows, held beyond its ends.
    """
    low, high, share = place(speed, table)
    for j in range(N_REFERENCE):
        below = table[low, 1 + j]
        s_row[start + j] = below + share * (table[high, 1 + j] - below)


@seldom
def set_speed(speed: float, p_row: Any, s_row: Any, table: Any, car_table: Any) -> None:
    """Put the reference and the car of a speed in m/s into the state row."""
    _row_at(speed, table, s_row, REFERENCE)
    _row_at(speed, car_table, s_row, CAR)
    spread = _car_spread(p_row)
    s_row[CAR_M] *= spread.mass
    s_row[CAR_J_Z] *= spread.mass
    s_row[CAR_C_F] *= spread.grip
    s_row[CAR_C_R] *= spread.grip
    s_row[CAR_N_T] *= spread.trail
    reference = _reference(s_row)
    for k in range(6):
        column = track_map_column(k, speed, reference, PERIOD)
        for j in range(4):
            s_row[TRACK + 4 * k + j] = column[j]


@scalar
def next_speed(speed: float, e: Episode) -> float:
    """Speed in m/s a period later."""
    if e.speed_rate > 0.0:
        return min(speed + e.speed_rate * PERIOD, max(e.speed_end, speed))
    if e.speed_rate < 0.0:
        return max(speed + e.speed_rate * PERIOD, min(e.speed_end, speed))
    return speed


@scalar
def through(line: int, k: int, value: float, delay: int, lines: Any) -> float:
    """Put the value of period ``k`` into a delay line of LINES; what comes out was put in ``delay`` periods ago."""
    lines[line, k & 15] = value
    return lines[line, (k - delay) & 15]


@scalar
def driven(
    x: PlantState,
    target: float,
    hand: Hand,
    speed: float,
    rack_share: float,
    steering: Steering,
    bandwidth_Hz: float,
    driver: Driver,
    car: ReferenceParameters,
    effects: Any,
) -> tuple[PlantState, float]:
    """The plant a period later, and its torsion-bar torque in N m."""
    h = PERIOD / SUBSTEPS
    decay = lag_decay(bandwidth_Hz, 0.5 * h)
    x = plant_steps(x, target, decay, hand, speed, rack_share, steering, driver, car, h, effects)
    M_tb, _ = bar_torques(
        x.steering_angle, x.steering_rate, x.pinion_angle, x.pinion_rate, steering.c_tb, steering.b_tb, effects
    )
    return x, M_tb


@scalar
def readings(
    x: PlantState, M_tb: float, noise_angle: float, noise_torque: float, sensors: Sensors
) -> tuple[float, float]:
    """What the sensors make of pinion angle in rad and torsion-bar torque in N m."""
    torque = sensors.torque_gain * M_tb + sensors.torque_offset
    return (
        measured(x.pinion_angle, sensors.angle_step, sensors.angle_noise, noise_angle),
        measured(torque, sensors.torque_step, sensors.torque_noise, noise_torque),
    )


@scalar
def judged(
    x: PlantState,
    M_tb: float,
    hand: Hand,
    speed: float,
    judge: ReferenceState,
    episode: Episode,
    weights: Reward,
    steering: Steering,
    driver: Driver,
    reference: ReferenceParameters,
    track: TrackMap,
    car: ReferenceParameters,
    effects: Any,
) -> tuple[float, float, float, ReferenceState]:
    """(ideal, true value minus it, cost, state): the generator fed with true signals, without delay."""
    if episode.admittance > 0.5:
        _, now = admittance_step(M_tb, judge, speed, reference, PERIOD)
        error = x.pinion_angle - now.pinion_angle
        return now.pinion_angle, error, abs(error) / weights.angle_scale, now
    q, v, frictions = plant.motion_of(x), plant.track_of(x), plant.frictions_of(x)
    rates, _ = plant.plant_rates(
        q, v, frictions, x.motor_torque, hand, speed, episode.rack_share, steering, driver, car, effects
    )
    ideal, _, now = impedance_step(x.pinion_angle, x.pinion_rate, rates.pinion_rate, judge, speed, reference, track)
    error = M_tb - ideal
    return ideal, error, abs(error) / weights.torque_scale, now


@scalar
def reward_parts(
    cost: float, command: float, before: float, rated_torque: float, weights: Reward
) -> tuple[float, float, float]:
    """(tracking, smoothness, effort) for a tracking cost, this command and the one before in N m."""
    change = (command - before) / rated_torque
    share = command / rated_torque
    return (
        -min(cost, PART_LIMIT),
        -min(weights.smoothness * change * change, PART_LIMIT),
        -min(weights.effort * share * share, PART_LIMIT),
    )


@scalar
def truth_of(
    k: int,
    x: PlantState,
    M_tb: float,
    limited: float,
    last: float,
    verdict: tuple[float, float, float],
    hand: Hand,
    speed: float,
    rack_share: float,
    motor: Motor,
    weights: Reward,
    driver: Driver,
    car: ReferenceParameters,
    effects: Any,
) -> Truth:
    """What the period ``k`` came to; ``verdict`` is (ideal, error, cost), ``last`` the command before."""
    ideal, error, cost = verdict
    tracking, smoothness, effort = reward_parts(cost, limited, last, motor.rated_torque, weights)
    unstable = abs(x.steering_rate) > RATE_LIMIT or abs(x.pinion_rate) > RATE_LIMIT or abs(M_tb) > TORQUE_LIMIT
    return Truth(
        (k + 1) * PERIOD,
        speed,
        x.steering_angle,
        x.steering_rate,
        driver_torque(x.steering_angle, x.steering_rate, hand.angle, hand.rate, hand.torque, hand.grip, driver),
        x.pinion_angle,
        x.pinion_rate,
        M_tb,
        x.motor_torque,
        limited,
        plant.rack_torque_at(x, speed, rack_share, car, effects),
        x.yaw_rate,
        lateral_acceleration(plant.track_of(x), single_track_of(car)),
        ideal,
        error,
        tracking,
        smoothness,
        effort,
        1.0 if unstable or math.isnan(x.pinion_rate) else 0.0,
    )
