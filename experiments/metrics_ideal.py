"""What the ideal would have been, in the cases in which an episode's own ``Truth.reference`` does not tell.

Three compiled passes over an episode: the torque of the reference at a motion (``ideal_torque``), the car's lateral
acceleration at an angle (``car_acceleration``), and the whole manoeuvre with the reference in place of everything
below the torsion bar (``ideal_drive``).
"""

from __future__ import annotations

import numpy as np

from experiments.rollout import Array, Episode
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, SUBSTEPS
from steer_env.envs.period import set_speed
from steer_env.manoeuvres import hand_at
from steer_env.physics import plant, vehicle
from steer_env.physics._jit import compiled, scalar
from steer_env.physics.driver import Driver, Hand, driver_torque
from steer_env.physics.friction import dahl_step
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    effective_torque,
    impedance_step,
    reference_rates,
    single_track_of,
)
from steer_env.physics.steering import Steering, SteeringMotion, moved, steering_rates, torsion_bar_torque
from steer_env.physics.vehicle import SingleTrackState, rk4_mean

DRIVEN = ("steering_angle", "pinion_angle", "yaw_rate")  # columns of ideal_drive

_steering = PARAMETERS.loader("steering")
_driver = PARAMETERS.loader("driver")
_manoeuvre = PARAMETERS.loader("manoeuvre")
_episode = PARAMETERS.loader("episode")
_load_reference = STATE.loader("reference")
_load_car = STATE.loader("car")
_load_track = STATE.loader("track")
_STATE_SIZE = STATE.size


def ideal_torque(episode: Episode) -> Array:
    """Torsion-bar torque [n] in N m of the impedance reference at the true pinion motion of an episode.

    The acceleration is not differenced: it is Newton's law at the pinion with the true torsion-bar, motor and rack
    torques, and the friction that the true angle leaves. In impedance this is the reference that was recorded.
    """
    names = ("steering_angle", "steering_rate", "pinion_angle", "pinion_rate", "motor_torque", "rack_torque", "speed")
    signals = np.column_stack([episode[name] for name in names])
    torque = np.zeros(len(signals))
    setup = episode.setup
    _ideal_torque(signals, setup.row, setup.table, setup.car_table, torque)
    return torque


def car_acceleration(episode: Episode, angle: Array) -> Array:
    """Lateral acceleration [n] in m/s2 of the episode's car if its pinion had gone through ``angle`` [n] in rad."""
    found = np.zeros(len(angle))
    setup = episode.setup
    _car_acceleration(
        np.ascontiguousarray(angle), np.ascontiguousarray(episode["speed"]),
        setup.row, setup.table, setup.car_table, found,
    )  # fmt: skip
    return found


def ideal_drive(episode: Episode) -> dict[str, Array]:
    """Signals [n] of DRIVEN (rad, rad/s) with the same hand, arm, wheel and torsion bar on the reference itself."""
    driven = np.zeros((len(episode.signals), len(DRIVEN)))
    setup = episode.setup
    _ideal_drive(np.ascontiguousarray(episode["speed"]), setup.row, setup.table, setup.car_table, driven)
    return dict(zip(DRIVEN, driven.T, strict=True))


@compiled
def _ideal_torque(signals: Array, p_row: Array, table: Array, car_table: Array, torque: Array) -> None:
    s_row = np.zeros(_STATE_SIZE)
    steering = _steering(p_row)
    state = ReferenceState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    friction, before, known = 0.0, 0.0, -1.0
    for k in range(signals.shape[0]):
        angle, rate, speed = signals[k, 2], signals[k, 3], signals[k, 6]
        if speed != known:
            set_speed(speed, p_row, s_row, table, car_table)
            known = speed
        friction = plant.bristle_torque(friction, angle - before, rate, steering)
        before = angle
        resisting = friction + plant.bristle_damping(friction, rate, steering)
        motion = SteeringMotion(signals[k, 0], signals[k, 1], angle, rate)
        rates = steering_rates(motion, 0.0, 0.0, resisting, signals[k, 5], signals[k, 4], 0.0, steering)
        torque[k], _, state = impedance_step(
            angle, rate, rates.pinion_rate, state, speed, _load_reference(s_row), _load_track(s_row)
        )


@compiled
def _car_acceleration(
    angle: Array, speeds: Array, p_row: Array, table: Array, car_table: Array, found: Array
) -> None:
    s_row = np.zeros(_STATE_SIZE)
    track = SingleTrackState(0.0, 0.0, 0.0, 0.0)
    before, known = 0.0, -1.0
    for k in range(angle.shape[0]):
        speed = speeds[k]
        if speed != known:
            set_speed(speed, p_row, s_row, table, car_table)
            known = speed
        car = _load_car(s_row)
        body = single_track_of(car)
        now = angle[k] * (1.0 / car.i_s)
        track = vehicle.single_track_step(track, before, 0.5 * (before + now), now, speed, body, PERIOD)
        before = now
        found[k] = vehicle.lateral_acceleration(track, body)


@scalar
def _slope(
    start: PlantState,
    q: SteeringMotion,
    v: SingleTrackState,
    hand: Hand,
    speed: float,
    steering: Steering,
    driver: Driver,
    p: ReferenceParameters,
) -> tuple[SteeringMotion, SingleTrackState]:
    """Derivatives at ``q``, ``v`` reached one way from ``start``: wheel and bar above, the reference below."""
    wheel_friction = dahl_step(
        start.wheel_friction, q.steering_angle - start.steering_angle, steering.M_s_fric, steering.c_s_fric
    )
    M_s = driver_torque(q.steering_angle, q.steering_rate, hand.angle, hand.rate, hand.torque, hand.grip, driver)
    wheel = steering_rates(q, M_s, wheel_friction, 0.0, 0.0, 0.0, driver.J * hand.grip, steering)
    M_eff = effective_torque(torsion_bar_torque(q, steering), p)
    friction = _reference_friction(start, q.pinion_angle, p)
    acceleration, track = reference_rates(q.pinion_angle, q.pinion_rate, v, M_eff, friction, speed, p)
    return SteeringMotion(wheel.steering_angle, wheel.steering_rate, q.pinion_rate, acceleration), track


@scalar
def _reference_friction(start: PlantState, angle: float, p: ReferenceParameters) -> float:
    if p.linear > 0.5:
        return 0.0
    return dahl_step(start.pinion_friction, angle - start.pinion_angle, p.M_fric_C, p.c_fric)


@scalar
def _step(
    x: PlantState, hand: Hand, speed: float, steering: Steering, driver: Driver, p: ReferenceParameters, h: float
) -> PlantState:
    """One classical Runge-Kutta step of h seconds; frictions are exact at every stage."""
    q, v = plant.motion_of(x), plant.track_of(x)
    k0, t0 = _slope(x, q, v, hand, speed, steering, driver, p)
    k1, t1 = _slope(x, moved(q, 0.5 * h, k0), vehicle.moved(v, 0.5 * h, t0), hand, speed, steering, driver, p)
    k2, t2 = _slope(x, moved(q, 0.5 * h, k1), vehicle.moved(v, 0.5 * h, t1), hand, speed, steering, driver, p)
    k3, t3 = _slope(x, moved(q, h, k2), vehicle.moved(v, h, t2), hand, speed, steering, driver, p)
    wheel = q.steering_angle + rk4_mean(k0[0], k1[0], k2[0], k3[0], h)
    wheel_rate = q.steering_rate + rk4_mean(k0[1], k1[1], k2[1], k3[1], h)
    pinion = q.pinion_angle + rk4_mean(k0[2], k1[2], k2[2], k3[2], h)
    pinion_rate = q.pinion_rate + rk4_mean(k0[3], k1[3], k2[3], k3[3], h)
    t = vehicle.moved_rk4(v, t0, t1, t2, t3, h)
    wheel_friction = dahl_step(x.wheel_friction, wheel - x.steering_angle, steering.M_s_fric, steering.c_s_fric)
    friction = _reference_friction(x, pinion, p)
    return PlantState(
        wheel, wheel_rate, pinion, pinion_rate, t.lateral_speed, t.yaw_rate, t.slip_front, t.slip_rear,
        wheel_friction, friction, 0.0, 0.0, 0.0,
    )  # fmt: skip


@compiled
def _ideal_drive(speeds: Array, p_row: Array, table: Array, car_table: Array, driven: Array) -> None:
    s_row = np.zeros(_STATE_SIZE)
    steering, driver = _steering(p_row), _driver(p_row)
    episode, manoeuvre = _episode(p_row), _manoeuvre(p_row)
    x = PlantState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    known = -1.0
    for k in range(speeds.shape[0]):
        if speeds[k] != known:
            known = speeds[k]
            set_speed(known, p_row, s_row, table, car_table)
        hand = hand_at(episode.kind, (k + 0.5) * PERIOD, manoeuvre)
        for _ in range(SUBSTEPS):
            x = _step(x, hand, known, steering, driver, _load_reference(s_row), PERIOD / SUBSTEPS)
        driven[k, 0], driven[k, 1], driven[k, 2] = x.steering_angle, x.pinion_angle, x.yaw_rate
