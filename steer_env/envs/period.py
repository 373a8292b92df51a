"""One control period of one environment: motor, plant, sensors, control unit, ideal, reward."""

from __future__ import annotations

import math
from typing import Any

from steer_env.envs.layout import (
    PARAMETERS,
    PERIOD,
    STATE,
    SUBSTEPS,
    Clock,
    Episode,
    Reward,
    Truth,
)
from steer_env.manoeuvres import hand_at
from steer_env.physics import plant
from steer_env.physics._jit import scalar
from steer_env.physics.control_unit import Commands, Observation, control_unit_step
from steer_env.physics.driver import Hand, driver_torque
from steer_env.physics.effects.acting import bar_torques
from steer_env.physics.motor import lag_decay, limited_command
from steer_env.physics.reference import (
    ReferenceParameters,
    admittance_step,
    impedance_step,
    single_track_of,
)
from steer_env.physics.sensors import measured
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

_steering = PARAMETERS.loader("steering")
_motor = PARAMETERS.loader("motor")
_driver = PARAMETERS.loader("driver")
_sensors = PARAMETERS.loader("sensors")
_observer = PARAMETERS.loader("observer")
_manoeuvre = PARAMETERS.loader("manoeuvre")
_episode = PARAMETERS.loader("episode")
_car_spread = PARAMETERS.loader("car_spread")
_reward = PARAMETERS.loader("reward")
_load_plant, _store_plant = STATE.loader("plant"), STATE.storer("plant")
_load_observer, _store_observer = STATE.loader("observer"), STATE.storer("observer")
_load_generator, _store_generator = STATE.loader("generator"), STATE.storer("generator")
_load_judge, _store_judge = STATE.loader("judge"), STATE.storer("judge")
_load_commands, _store_commands = STATE.loader("commands"), STATE.storer("commands")
_load_clock, _store_clock = STATE.loader("clock"), STATE.storer("clock")
_load_reference = STATE.loader("reference")
_load_car = STATE.loader("car")


@scalar
def _row_at(speed: float, table: Any, s_row: Any, start: int) -> None:
    """Write the parameters at a speed in m/s from a table [n, 1 + n_fields] to s_row[start:].

    Straight between the table's rows, held beyond its ends.
    """
    last = table.shape[0] - 1
    low = 0
    while low < last - 1 and table[low + 1, 0] <= speed:
        low += 1
    high = min(low + 1, last)
    span = table[high, 0] - table[low, 0]
    share = 0.0 if span <= 0.0 else min(max((speed - table[low, 0]) / span, 0.0), 1.0)
    for j in range(N_REFERENCE):
        below = table[low, 1 + j]
        s_row[start + j] = below + share * (table[high, 1 + j] - below)


@scalar
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


@scalar
def next_speed(speed: float, e: Episode) -> float:
    """Speed in m/s one period later."""
    if e.speed_rate > 0.0:
        return min(speed + e.speed_rate * PERIOD, max(e.speed_end, speed))
    if e.speed_rate < 0.0:
        return max(speed + e.speed_rate * PERIOD, min(e.speed_end, speed))
    return speed


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
def control_period(
    command: float,
    noise_angle: float,
    noise_torque: float,
    p_row: Any,
    s_row: Any,
    lines: Any,
    table: Any,
    car_table: Any,
    effects: Any = None,
) -> tuple[Observation, Truth]:
    """Run one period with a motor command in N m; rows change in place; (observation, truth).

    ``effects`` is the row of the catalogue's effects in the plant, or None.

    ``lines`` [4, 16] are the delay lines of LINES; ``table`` and ``car_table`` are references over
    speed. The two noises are standard normal draws handed in.
    """
    motor, steering, sensors, driver = (
        _motor(p_row),
        _steering(p_row),
        _sensors(p_row),
        _driver(p_row),
    )
    episode, clock, commands = _episode(p_row), _load_clock(s_row), _load_commands(s_row)
    k = int(clock.period)
    speed = next_speed(clock.speed, episode)
    if speed != clock.speed:
        set_speed(speed, p_row, s_row, table, car_table)
    reference, car = _load_reference(s_row), _load_car(s_row)

    limited = limited_command(command, commands.last_1, motor, PERIOD)
    lines[0, k & 15] = limited
    target = lines[0, (k - int(motor.dead_time)) & 15]
    hand = hand_at(episode.kind, (k + 0.5) * PERIOD, _manoeuvre(p_row))
    h = PERIOD / SUBSTEPS
    decay = lag_decay(motor.bandwidth_Hz, 0.5 * h)
    x = _load_plant(s_row)
    for _ in range(SUBSTEPS):
        x = plant.plant_step(x, target, decay, hand, speed, episode.rack_share, steering, driver, car, h, effects)
    _store_plant(s_row, x)

    q = plant.motion_of(x)
    M_tb, _ = bar_torques(
        q.steering_angle, q.steering_rate, q.pinion_angle, q.pinion_rate, steering.c_tb, steering.b_tb, effects
    )
    ideal, error, cost = _judge(x, q, M_tb, hand, speed, p_row, s_row, reference, car, effects)

    lines[1, k & 15] = measured(x.pinion_angle, sensors.angle_step, sensors.angle_noise, noise_angle)
    lines[2, k & 15] = measured(
        sensors.torque_gain * M_tb + sensors.torque_offset, sensors.torque_step, sensors.torque_noise, noise_torque
    )
    lines[3, k & 15] = x.motor_torque
    sensed_at = (k - int(sensors.angle_delay)) & 15
    commands = Commands(limited, commands.last_1, commands.last_2, commands.last_3)
    observation, seen, generator = control_unit_step(
        lines[1, sensed_at],
        lines[2, (k - int(sensors.torque_delay)) & 15],
        lines[3, sensed_at],
        commands,
        speed,
        episode.admittance,
        _load_observer(s_row),
        _load_generator(s_row),
        clock.last_reference,
        _observer(p_row),
        reference,
        PERIOD,
    )
    _store_observer(s_row, seen)
    _store_generator(s_row, generator)
    _store_commands(s_row, commands)
    _store_clock(s_row, Clock(k + 1.0, speed, observation.reference))

    tracking, smoothness, effort = reward_parts(cost, limited, commands.last_2, motor.rated_torque, _reward(p_row))
    track = plant.track_of(x)
    unstable = abs(x.steering_rate) > RATE_LIMIT or abs(x.pinion_rate) > RATE_LIMIT or abs(M_tb) > TORQUE_LIMIT
    truth = Truth(
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
        plant.rack_torque_at(x, speed, episode.rack_share, car, effects),
        x.yaw_rate,
        lateral_acceleration(track, single_track_of(car)),
        ideal,
        error,
        tracking,
        smoothness,
        effort,
        1.0 if unstable or math.isnan(x.pinion_rate) else 0.0,
    )
    return observation, truth


@scalar
def _judge(
    x: plant.PlantState,
    q: Any,
    M_tb: float,
    hand: Hand,
    speed: float,
    p_row: Any,
    s_row: Any,
    reference: ReferenceParameters,
    car: ReferenceParameters,
    effects: Any,
) -> tuple[float, float, float]:
    """(ideal, true value minus it, cost): the generator fed with true signals, without delay."""
    episode, weights = _episode(p_row), _reward(p_row)
    if episode.admittance > 0.5:
        _, judge = admittance_step(M_tb, _load_judge(s_row), speed, reference, PERIOD)
        ideal, error, scale = (
            judge.pinion_angle,
            x.pinion_angle - judge.pinion_angle,
            weights.angle_scale,
        )
    else:
        rates, _ = plant.plant_rates(
            x,
            q,
            plant.track_of(x),
            x.motor_torque,
            hand,
            speed,
            episode.rack_share,
            _steering(p_row),
            _driver(p_row),
            car,
            effects,
        )
        ideal, _, judge = impedance_step(
            x.pinion_angle,
            x.pinion_rate,
            rates.pinion_rate,
            _load_judge(s_row),
            speed,
            reference,
            PERIOD,
        )
        error, scale = M_tb - ideal, weights.torque_scale
    _store_judge(s_row, judge)
    return ideal, error, abs(error) / scale
