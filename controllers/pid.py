"""PID with reference feed-forward and torsion-bar damping: on torque (impedance) or angle error.

Feed-forward: reference (4) minus plant (2) says what the motor must add,

    i M_mot = (J_pin - J_ref) a + (b_pin - b_ref) w + (M_eff - M_tb) + (M_fric - M_ref,fric)

where the car loads the lower body, and i M_mot = J_pin a + b_pin w + M_fric - M_tb,ref for
steer-by-wire. Written once for both: i M_mot = J_pin a + b_pin w + M_fric + share M_load - M_tb,ref
with M_load = M_eff - J_ref a - b_ref w - M_ref,fric.

Where it ends: at 15 and 30 km/h the tables have b_ref < 0 and the assist's slope goes up to 330 and
49. A reference that follows that slope outruns any motor behind a delay, so where the assist is
steep the angle law yields and renders torque instead: stable, but no longer on the reference angle.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from controllers.blocks import NotchState, aged_command, assist_slope, low_pass, notch_step, torque_of
from controllers.law import Gain, LawController, with_gains
from controllers.pid_design import PidParameters, design
from controllers.schedule import Felt, felt_at
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.physics.motor import lag_step
from steer_env.plants import Plant, Reference

# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "torque_gain": (0.3, 2.5),
    "torque_integral": (0.1, 10.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "derivative_bandwidth": (0.5, 2.0),
    "bar_damping": (0.5, 1.5),
    "torque_lag": (0.5, 2.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 3.0),
    "angle_gain": (0.2, 6.0),
    "angle_integral": (0.1, 10.0),
    "angle_derivative": (0.4, 3.0),
}

CUT = 1e-3  # N m at the motor: a command cut by more than this met a limit, not a rounding


class PidState(NamedTuple):
    """Memory of both laws: integral and torques in N m, accelerations in rad/s2, angles in rad."""

    integral: float = 0.0
    torque: float = 0.0
    acceleration_1: float = 0.0
    acceleration_2: float = 0.0
    friction: float = 0.0
    friction_angle: float = 0.0
    reference_friction: float = 0.0
    reference_angle: float = 0.0
    commanded: float = 0.0
    own_friction: float = 0.0
    motor_torque: float = 0.0
    load: float = 0.0
    notch: NotchState = NotchState()


@scalar
def least_damping(felt: Felt, p: PidParameters) -> float:
    """Damping in N m s/rad that the reference lacks of ``damping_ratio`` while friction sticks.

    At 15 and 30 km/h the identified b_ref is negative: against a locked wheel the reference itself
    is unstable, so no controller may render it fully.
    """
    stuck = felt.c_fric if felt.M_fric_C > 0.0 else 0.0
    stiffness = stuck + p.bar_damping * p.c_tb
    wanted = 2.0 * p.damping_ratio * math.sqrt(felt.J_ref * stiffness)
    return max(wanted - felt.b_ref, 0.0)


@scalar
def integrated(integral: float, rate: float, o: Observation, x: PidState, p: PidParameters) -> float:
    """Integral in N m one period on; it waits while the motor's limits cut the command.

    Running it back instead (back-calculation) would charge it with whatever feed-forward asks in
    excess of the motor.
    """
    limited = abs(o.last_torque_1 - x.commanded) > CUT
    return integral if limited else integral + p.period * rate


@scalar
def matched_gain(felt: Felt, p: PidParameters) -> float:
    """Gain on the torque error that makes the hardware's inertia serve as the reference's.

    A total gain of K J_pin / J_ref on M_tb turns J_pin a into J_ref a at the gain K: nothing to
    add, nothing to cancel.
    """
    return p.torque_gain * max((1.0 + felt.k_gain) * p.J_pin / felt.J_ref - 1.0, 0.0)


@scalar
def load_of(o: Observation, acceleration: float, rate: float, friction: float, felt: Felt) -> float:
    """M_rack (with c_extra d) in N m: what Eq. 4 leaves of M_eff at the reference's motion."""
    return o.effective_torque - felt.J_ref * acceleration - felt.b_ref * rate - friction


@scalar
def load_seen(o: Observation, motor_torque: float, friction: float, p: Any) -> float:
    """Load on the lower body in N m: what its motion under bar and motor leaves unexplained.

    ``motor_torque`` in N m at its shaft is as old as the measured angle, ``friction`` the hardware's.
    """
    moved: float = p.J_pin * o.pinion_acceleration + p.b_pin * o.pinion_rate + friction
    return o.torsion_bar_torque + p.motor_ratio * motor_torque - moved


@scalar
def foretold(acceleration: float, o: Observation, felt: Felt, p: Any) -> float:
    """What M_eff gains in N m until the command acts.

    What is measured is late and what is commanded acts late: stiffness and damping are taken where the
    pinion will be. The acceleration cannot be foretold: late inertia feels like damping and like less
    inertia. Stiffness foretold by less and damping by more than the delay make up for that where both matter.
    """
    ahead: float = p.prediction * felt.stiffness * o.pinion_rate
    ahead = ahead + p.damping_prediction * felt.b_ref * acceleration
    return ahead


@scalar
def steep_share(slope: float, p: Any) -> float:
    """How far an angle law yields to rendering torque: not at all up to ``slope_limit`` of the assist.

    With a rack, whose load the motion shows, wholly from twice that slope on: a motor behind a delay
    cannot follow a reference that runs off at the full slope. Without a rack the load is known at the
    reference's angle only, so that the angle loop has to keep a share.
    """
    if p.rack_share > 0.5:
        return min(max(slope / p.slope_limit - 1.0, 0.0), 1.0)
    return max(1.0 - p.slope_limit / slope, 0.0)


@scalar
def torque_law(o: Observation, x: PidState, p: PidParameters) -> tuple[float, PidState]:
    """Impedance: feed-forward from the measured motion, PI on torque error, D on torque."""
    felt = felt_at(o.speed, p.schedule)
    a_1 = low_pass(x.acceleration_1, o.pinion_acceleration, p.acceleration_bandwidth, p.period)
    a_2 = low_pass(x.acceleration_2, a_1, p.acceleration_bandwidth, p.period)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.reference_friction, o.pinion_angle - x.reference_angle, felt.M_fric_C, felt.c_fric)
    load = load_of(o, o.pinion_acceleration, o.pinion_rate, felt_friction, felt)
    # The wide-band acceleration would close a loop around the motor's own torque: the reference
    # gets the filtered one.
    lack = least_damping(felt, p)
    damping = (1.0 - p.bar_damping) * lack * o.pinion_rate
    ahead = foretold(a_2, o, felt, p)
    wanted = torque_of(o.effective_torque - felt.J_ref * (o.pinion_acceleration - a_2) + damping + ahead, felt)

    gain = matched_gain(felt, p)
    error = wanted - o.torsion_bar_torque
    integral = integrated(x.integral, -p.torque_integral * error, o, x, p)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.derivative_bandwidth, p.period)
    lead = p.bar_damping * ((1.0 + gain) * p.delay + lack / p.c_tb)
    bar = lead * p.derivative_bandwidth * (o.torsion_bar_torque - torque)

    # Off centre the felt inertia J_ref / K is small and hardly any of it returns through the gain:
    # cancelling all of the hardware's then leaves a body without inertia behind a delay. Only a
    # share of what is left over is cancelled.
    felt_inertia = (1.0 + gain) * felt.J_ref / assist_slope(wanted, felt)
    inertia = min(p.J_pin, felt_inertia + p.inertia_share * p.J_pin)
    lower = inertia * a_2 + p.b_pin * o.pinion_rate + friction + p.rack_share * load - wanted
    lower = lower - gain * error + integral + bar
    output, notch = notch_step(lower, x.notch, p.notch)
    command = output / p.motor_ratio
    return command, PidState(
        integral,
        torque,
        a_1,
        a_2,
        friction,
        o.pinion_angle,
        felt_friction,
        o.pinion_angle,
        command,
        0.0,
        0.0,
        0.0,
        notch,
    )


@scalar
def angle_law(o: Observation, x: PidState, p: PidParameters) -> tuple[float, PidState]:
    """Admittance: feed-forward from reference motion and measured torque, PID on angle error."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.reference_friction, o.reference - x.reference_angle, felt.M_fric_C, felt.c_fric)
    own_friction = dahl_step(x.own_friction, o.pinion_angle - x.friction_angle, felt.M_fric_C, felt.c_fric)
    load = load_of(o, o.reference_acceleration, o.reference_rate, felt_friction, felt)
    motor = lag_step(x.motor_torque, aged_command(o, p.command_age), p.motor_decay)
    seen = low_pass(x.load, load_seen(o, motor, friction, p), p.acceleration_bandwidth, p.period)
    error = o.reference - o.pinion_angle
    error_rate = o.reference_rate - o.pinion_rate
    a_1 = low_pass(x.acceleration_1, o.pinion_acceleration, p.acceleration_bandwidth, p.period)
    a_2 = low_pass(x.acceleration_2, a_1, p.acceleration_bandwidth, p.period)

    # Where the assist is steep, torque moves the reference faster than a motor behind a delay can
    # follow: there the law yields from tracking the angle to rendering the torque that the angle
    # error stands for, as in impedance; with a rack wholly, at the load that the motion shows.
    slope = assist_slope(o.torsion_bar_torque, felt)
    yielding = steep_share(slope, p)
    wholly = p.rack_share * yielding
    pull = p.angle_gain * error + p.angle_derivative * error_rate
    gap = felt.J_ref * (o.reference_acceleration - a_2 + (1.0 - p.rack_share) * pull) + felt.b_ref * error_rate
    shown = wholly * (seen - load)
    lack = least_damping(felt, p)
    M_eff = o.effective_torque - yielding * (gap - lack * o.pinion_rate)
    wanted = torque_of(M_eff + shown + wholly * (own_friction - felt_friction), felt)
    gain = matched_gain(felt, p)
    # Steer-by-wire: the hand's torque answers every correction, and through the assist it moves the
    # reference by K / J_ref. That, not the rotor's small inertia, is what the angle loop works
    # against.
    inertia = p.rack_share * p.J_pin + (1.0 - p.rack_share) * felt.J_ref / slope
    integral = integrated(x.integral, (1.0 - yielding) * inertia * p.angle_integral * error, o, x, p)
    feedback = (1.0 - yielding) * inertia * pull + integral

    torque = low_pass(x.torque, o.torsion_bar_torque, p.derivative_bandwidth, p.period)
    loop_gain = (1.0 - yielding) * slope + yielding * (1.0 + gain)
    lead = p.bar_damping * (loop_gain * p.delay + lack / p.c_tb) + p.torque_lag
    bar = lead * p.derivative_bandwidth * (o.torsion_bar_torque - torque)
    damping = (1.0 - yielding) * (1.0 - p.bar_damping) * lack / slope * o.pinion_rate

    acceleration = (1.0 - yielding) * o.reference_acceleration + yielding * p.inertia_share * a_2
    rate = (1.0 - yielding) * o.reference_rate + yielding * o.pinion_rate
    lower = p.J_pin * acceleration + p.b_pin * rate + friction + p.rack_share * load + shown
    lower = lower - wanted - gain * (wanted - o.torsion_bar_torque) + feedback + bar - damping
    output, notch = notch_step(lower, x.notch, p.notch)
    command = output / p.motor_ratio
    return command, PidState(
        integral,
        torque,
        a_1,
        a_2,
        friction,
        o.pinion_angle,
        felt_friction,
        o.reference,
        command,
        own_friction,
        motor,
        seen,
        notch,
    )


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of PidParameters."""

    def for_period(period: float) -> PidParameters:
        return with_gains(design(plant, reference, period), gains, "pid")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, PidState())
