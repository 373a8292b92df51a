"""One control period on a real motor: what was measured becomes observation, reference, reward and info.

The rows are those of a simulated environment (``layout.py``), the control unit and the reward the same functions. What
only a simulation knows is replaced: the ideal reference is the control unit's own, the true torque and angle are the
measured ones; the car that would follow is simulated from the measured angle.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.layout import OBSERVATION_LIMIT, PARAMETERS, PERIOD, STATE, Clock, Truth
from steer_env.envs.parts import RATE_LIMIT, TORQUE_LIMIT, next_speed, reward_parts, set_speed
from steer_env.physics import vehicle
from steer_env.physics._jit import compiled, scalar
from steer_env.physics.control_unit import Commands, Observation, control_unit_step
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import single_track_of

Array = NDArray[np.float64]

_steering = PARAMETERS.loader("steering")
_motor = PARAMETERS.loader("motor")
_observer = PARAMETERS.loader("observer")
_episode = PARAMETERS.loader("episode")
_reward = PARAMETERS.loader("reward")
_load_plant, _store_plant = STATE.loader("plant"), STATE.storer("plant")
_load_observer, _store_observer = STATE.loader("observer"), STATE.storer("observer")
_load_generator, _store_generator = STATE.loader("generator"), STATE.storer("generator")
_load_commands, _store_commands = STATE.loader("commands"), STATE.storer("commands")
_load_clock, _store_clock = STATE.loader("clock"), STATE.storer("clock")
_load_reference = STATE.loader("reference")
_load_track, _load_car = STATE.loader("track"), STATE.loader("car")


@scalar
def measured_period(
    applied: float,
    angle: float,
    M_tb: float,
    motor_torque: float,
    p_row: Any,
    s_row: Any,
    table: Any,
    car_table: Any,
) -> tuple[Observation, Truth]:
    """Take one period's measurements in; rows change in place; (observation, what is known of the truth).

    ``applied`` is the command in N m that left the safety layer, ``angle`` in rad, ``M_tb`` and ``motor_torque`` in
    N m as measured or estimated. The driver's torque is M_tb plus what the wheel's own inertia and bearing take.
    """
    episode, clock, commands = _episode(p_row), _load_clock(s_row), _load_commands(s_row)
    steering, motor, weights = _steering(p_row), _motor(p_row), _reward(p_row)
    speed = next_speed(clock.speed, episode)
    if speed != clock.speed:
        set_speed(speed, p_row, s_row, table, car_table)
    commands = Commands(applied, commands.last_1, commands.last_2, commands.last_3)
    observation, seen, generator = control_unit_step(
        angle,
        M_tb,
        motor_torque,
        commands,
        speed,
        episode.admittance,
        _load_observer(s_row),
        _load_generator(s_row),
        clock.last_reference,
        _observer(p_row),
        _load_reference(s_row),
        _load_track(s_row),
        PERIOD,
    )
    _store_observer(s_row, seen)
    _store_generator(s_row, generator)
    _store_commands(s_row, commands)
    _store_clock(s_row, Clock(clock.period + 1.0, speed, observation.reference))

    x, car = _load_plant(s_row), single_track_of(_load_car(s_row))
    before, after = x.pinion_angle * (1.0 / car.i_s), angle * (1.0 / car.i_s)
    track = vehicle.SingleTrackState(x.lateral_speed, x.yaw_rate, x.slip_front, x.slip_rear)
    track = vehicle.single_track_step(track, before, 0.5 * (before + after), after, speed, car, PERIOD)
    twist = M_tb / steering.c_tb
    _store_plant(
        s_row,
        PlantState(
            angle + twist, seen.rate, angle, seen.rate, track.lateral_speed, track.yaw_rate, track.slip_front,
            track.slip_rear, 0.0, 0.0, motor_torque, 0.0, 0.0,
        ),
    )  # fmt: skip

    if episode.admittance > 0.5:
        error = angle - observation.reference
        cost = abs(error) / weights.angle_scale
    else:
        error = M_tb - observation.reference
        cost = abs(error) / weights.torque_scale
    tracking, smoothness, effort = reward_parts(cost, applied, commands.last_2, motor.rated_torque, weights)
    unstable = abs(seen.rate) > RATE_LIMIT or abs(M_tb) > TORQUE_LIMIT or math.isnan(seen.rate)
    truth = Truth(
        (clock.period + 1.0) * PERIOD,
        speed,
        angle + twist,
        seen.rate,
        M_tb + steering.J_s * observation.pinion_acceleration + steering.b_s * seen.rate,
        angle,
        seen.rate,
        M_tb,
        motor_torque,
        applied,
        0.0,
        track.yaw_rate,
        vehicle.lateral_acceleration(track, car),
        observation.reference,
        error,
        tracking,
        smoothness,
        effort,
        1.0 if unstable else 0.0,
    )
    return observation, truth


@compiled
def step_measured(
    applied: float,
    angle: float,
    M_tb: float,
    motor_torque: float,
    p_row: Array,
    s_row: Array,
    table: Array,
    car_table: Array,
    scales: Array,
    observation: Array,
    scaled: NDArray[np.float32],
    truth: Array,
) -> None:
    """``measured_period`` of one environment; fills observation [o] in SI, the same scaled [o], and truth [t]."""
    seen, known = measured_period(applied, angle, M_tb, motor_torque, p_row, s_row, table, car_table)
    for j in range(len(seen)):
        observation[j] = seen[j]
        share = seen[j] / scales[j]
        scaled[j] = min(max(share, -OBSERVATION_LIMIT), OBSERVATION_LIMIT)
    for j in range(len(known)):
        truth[j] = known[j]
