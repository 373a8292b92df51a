"""One control period of one environment: motor, plant, sensors, control unit, ideal, reward."""

from __future__ import annotations

from typing import Any

from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Clock, Truth
from steer_env.envs.parts import driven, judged, next_speed, readings, set_speed, through, truth_of
from steer_env.manoeuvres import hand_at
from steer_env.physics._jit import scalar
from steer_env.physics.control_unit import Commands, Observation, control_unit_step
from steer_env.physics.motor import limited_command

__all__ = ["control_period", "set_speed"]

_steering = PARAMETERS.loader("steering")
_motor = PARAMETERS.loader("motor")
_driver = PARAMETERS.loader("driver")
_sensors = PARAMETERS.loader("sensors")
_observer = PARAMETERS.loader("observer")
_manoeuvre = PARAMETERS.loader("manoeuvre")
_episode = PARAMETERS.loader("episode")
_reward = PARAMETERS.loader("reward")
_load_plant, _store_plant = STATE.loader("plant"), STATE.storer("plant")
_load_observer, _store_observer = STATE.loader("observer"), STATE.storer("observer")
_load_generator, _store_generator = STATE.loader("generator"), STATE.storer("generator")
_load_judge, _store_judge = STATE.loader("judge"), STATE.storer("judge")
_load_commands, _store_commands = STATE.loader("commands"), STATE.storer("commands")
_load_clock, _store_clock = STATE.loader("clock"), STATE.storer("clock")
_load_reference = STATE.loader("reference")
_load_track, _load_car = STATE.loader("track"), STATE.loader("car")


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
    motor, steering, sensors, driver = _motor(p_row), _steering(p_row), _sensors(p_row), _driver(p_row)
    episode, weights, clock, commands = _episode(p_row), _reward(p_row), _load_clock(s_row), _load_commands(s_row)
    k = int(clock.period)
    speed = next_speed(clock.speed, episode)
    if speed != clock.speed:
        set_speed(speed, p_row, s_row, table, car_table)
    reference, track, car = _load_reference(s_row), _load_track(s_row), _load_car(s_row)

    limited = limited_command(command, commands.last_1, motor, PERIOD)
    target = through(0, k, limited, int(motor.dead_time), lines)
    hand = hand_at(episode.kind, (k + 0.5) * PERIOD, _manoeuvre(p_row))
    x, M_tb = driven(
        _load_plant(s_row), target, hand, speed, episode.rack_share, steering, motor.bandwidth_Hz, driver, car, effects
    )
    _store_plant(s_row, x)
    ideal, error, cost, judge = judged(
        x, M_tb, hand, speed, _load_judge(s_row), episode, weights, steering, driver, reference, track, car, effects
    )
    _store_judge(s_row, judge)

    angle, torque = readings(x, M_tb, noise_angle, noise_torque, sensors)
    late = int(sensors.angle_delay)
    angle = through(1, k, angle, late, lines)
    torque = through(2, k, torque, int(sensors.torque_delay), lines)
    motor_estimate = through(3, k, x.motor_torque, late, lines)
    sent = Commands(limited, commands.last_1, commands.last_2, commands.last_3)
    observation, seen, generator = control_unit_step(
        angle,
        torque,
        motor_estimate,
        sent,
        speed,
        episode.admittance,
        _load_observer(s_row),
        _load_generator(s_row),
        clock.last_reference,
        _observer(p_row),
        reference,
        track,
        PERIOD,
    )
    _store_observer(s_row, seen)
    _store_generator(s_row, generator)
    _store_commands(s_row, sent)
    _store_clock(s_row, Clock(k + 1.0, speed, observation.reference))
    verdict = ideal, error, cost
    truth = truth_of(
        k, x, M_tb, limited, commands.last_1, verdict, hand, speed, episode.rack_share, motor, weights, driver, car,
        effects,
    )  # fmt: skip
    return observation, truth
