"""What lead and disturbance observer share: targets as torsion-bar torques, and what the model takes.

``p`` is the record of the law that calls; it has the fields named here: period, J_pin, b_pin,
M_fric, c_fric, motor_ratio, prediction, damping_prediction, command_age, motor_decay, rack_share,
acceleration_bandwidth, gain, natural, damping_ratio, inertia_share, slope_limit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from controllers.blocks import aged_command, assist_slope, low_pass, torque_of
from controllers.pid import foretold, load_of, load_seen, steep_share
from controllers.schedule import Felt
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.physics.motor import lag_step


class MotionState(NamedTuple):
    """Accelerations in rad/s2 (one and two lags), friction torques in N m, the angles these follow in rad.

    ``friction`` is the hardware's and ``felt_friction`` the reference's, which follows the reference's
    angle; ``own_friction`` is the reference's at the pinion's angle. ``motor_torque`` in N m at its
    shaft is as old as the measured angle; ``load`` in N m is what the lower body's motion shows of the
    load (lagged).
    """

    acceleration_1: float = 0.0
    acceleration_2: float = 0.0
    friction: float = 0.0
    friction_angle: float = 0.0
    felt_friction: float = 0.0
    felt_angle: float = 0.0
    own_friction: float = 0.0
    motor_torque: float = 0.0
    load: float = 0.0


class Target(NamedTuple):
    """In N m: wanted torsion-bar torque, what the lower body's own motion takes, load and friction."""

    wanted: float
    model: float
    known: float


@scalar
def motion_step(felt_angle: float, o: Observation, felt: Felt, x: MotionState, p: Any) -> MotionState:
    """Next state; the reference's friction follows ``felt_angle`` in rad, the hardware's the pinion."""
    a_1 = low_pass(x.acceleration_1, o.pinion_acceleration, p.acceleration_bandwidth, p.period)
    a_2 = low_pass(x.acceleration_2, a_1, p.acceleration_bandwidth, p.period)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, felt_angle - x.felt_angle, felt.M_fric_C, felt.c_fric)
    own_friction = dahl_step(x.own_friction, o.pinion_angle - x.friction_angle, felt.M_fric_C, felt.c_fric)
    motor = lag_step(x.motor_torque, aged_command(o, p.command_age), p.motor_decay)
    load = low_pass(x.load, load_seen(o, motor, friction, p), p.acceleration_bandwidth, p.period)
    return MotionState(a_1, a_2, friction, o.pinion_angle, felt_friction, felt_angle, own_friction, motor, load)


@scalar
def gain_at(felt: Felt, p: Any) -> float:
    """Gain on the torque error: with 1 + gain = K J_pin / J_ref the hardware's inertia is felt as J_ref."""
    gain: float = p.gain * max((1.0 + felt.k_gain) * p.J_pin / felt.J_ref - 1.0, 0.0)
    return gain


@scalar
def torque_target(o: Observation, felt: Felt, motion: MotionState, p: Any) -> Target:
    """Impedance: the reference torque at the measured motion."""
    a_2 = motion.acceleration_2
    load = load_of(o, o.pinion_acceleration, o.pinion_rate, motion.felt_friction, felt)
    # The wide-band acceleration would close a loop around the motor's own torque.
    ahead = foretold(a_2, o, felt, p)
    wanted = torque_of(o.effective_torque - felt.J_ref * (o.pinion_acceleration - a_2) + ahead, felt)
    # Off centre the felt inertia is small; cancelling more of the hardware's would leave a body
    # without inertia behind a delay.
    felt_inertia = (1.0 + gain_at(felt, p)) * felt.J_ref / assist_slope(wanted, felt)
    inertia = min(p.J_pin, felt_inertia + p.inertia_share * p.J_pin)
    return Target(wanted, inertia * a_2 + p.b_pin * o.pinion_rate, motion.friction + p.rack_share * load)


@scalar
def loop_gain(o: Observation, felt: Felt, p: Any) -> float:
    """What torque comes back per torque in an angle law: the reference's acceleration, and what it yields to."""
    slope = assist_slope(o.torsion_bar_torque, felt)
    steep = steep_share(slope, p)
    return (1.0 - steep) * slope + steep * (1.0 + gain_at(felt, p))


@scalar
def angle_target(o: Observation, felt: Felt, motion: MotionState, p: Any) -> Target:
    """Admittance: the reference torque at the motion that brings the angle back.

    M_eff - J_ref (w^2 e + 2 z w e') turns angle error into torque error by the reference's own
    inertia and assist.
    """
    error, error_rate = o.reference - o.pinion_angle, o.reference_rate - o.pinion_rate
    pull = p.natural * p.natural * error + 2.0 * p.damping_ratio * p.natural * error_rate
    return pulled_target(pull, o, felt, motion, p)


@scalar
def pulled_target(pull: float, o: Observation, felt: Felt, motion: MotionState, p: Any) -> Target:
    """As ``angle_target``, for an acceleration ``pull`` in rad/s2 that brings the angle back; 0: feed-forward alone."""
    error_rate = o.reference_rate - o.pinion_rate
    # Where the assist is steep the reference runs away from any motor behind a delay: its
    # acceleration is then no longer fed forward, but asked for as torque, and the load is the one
    # that the motion shows, not the one at the reference's angle.
    steep = steep_share(assist_slope(o.torsion_bar_torque, felt), p)
    load = load_of(o, o.reference_acceleration, o.reference_rate, motion.felt_friction, felt)
    yielded = p.rack_share * steep
    shown = yielded * (motion.load - load)
    lag = steep * (o.reference_acceleration - motion.acceleration_2)
    gap = felt.J_ref * ((1.0 - yielded) * pull + lag) + felt.b_ref * steep * error_rate
    wanted = torque_of(o.effective_torque - gap + shown + yielded * (motion.own_friction - motion.felt_friction), felt)
    acceleration = (1.0 - steep) * o.reference_acceleration + steep * p.inertia_share * motion.acceleration_2
    rate = (1.0 - steep) * o.reference_rate + steep * o.pinion_rate
    known = motion.friction + p.rack_share * load + shown
    return Target(wanted, p.J_pin * acceleration + p.b_pin * rate, known)
