"""Super-twisting: a continuous second-order sliding mode on the torque or the angle error.

controllers.twisting has the algorithm, its gains and its discretisation; here stands what slides.
What the model knows (feed-forward of the reference, matched gain, lead on the torsion-bar torque) is
the equivalent control, as in ``lead``; the algorithm finds what is left, whose rate is bounded by
``disturbance_rate`` L at the lower body.

Impedance, s = integral of e, e = M_wanted - M_tb. Below the torsion bar's mode the sensor answers the
motor at once (relative degree zero), so that the error's integral is what has degree one:
s' = e = -(i M_mot + d) / (1 + gain). On s = s' = 0 the torque error itself is zero.

Admittance, s = e' + ``slope`` e, e = angle_ref - angle: s' = -(i M_mot + d) / J with J = J_pin behind a
soft bar. Behind a stiff sensor the hand's torque answers every correction and moves the reference by
K / J_ref, so that 1/J = K / J_ref + 1 / (J_pin + J_s), K the assist's slope. Where b_ref is negative
(15 and 30 km/h) ``damping_share`` of it is put back, or the reference would swing by itself while friction
sticks.

``fastest`` poles are shares of 1 / T_d (hardware.total_delay), found by eigenvalues over arms, speeds
and operating points (experiments.robustness); where the assist is steep the law yields to rendering
torque as the other angle laws do (controllers.tracking). The boundary layer that this leaves
is wide: for torques below 5 L / fastest (3.5 N m in the steer-by-wire angle loop, 16 N m and more in the
others) the law works as a PI controller on s and does not chatter; beyond, its gain falls as a sliding
mode's does. Both integrals wait while a limit of the motor cuts the command.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.blocks import Notch, NotchState, assist_slope, low_pass, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.pid import steep_share
from controllers.schedule import Felt, Schedule, felt_at
from controllers.tracking import MotionState, Target, gain_at, loop_gain, motion_step, pulled_target, torque_target
from controllers.twisting import MARGIN, twist_step
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
CUT = 1e-3  # N m at the motor: a command cut by more than this met a limit, not a rounding
UNKNOWN_RATE = 0.3  # rad/s of slow steering at which friction that the model does not know turns over
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "disturbance_rate": (0.2, 10.0),
    "fastest": (0.3, 2.0),
    "slope": (0.3, 3.0),
    "gain": (0.3, 2.5),
    "lead": (0.4, 2.0),
    "lead_bandwidth": (0.5, 2.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "torque_lag": (0.5, 2.0),
    "damping_share": (0.3, 3.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 3.0),
}


class TwistParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction that is compensated", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    slope_limit: Annotated[float, Quantity("-", "assist slope beyond which the angle yields", 1.0, 50.0, "assumption")]
    prediction: Annotated[float, Quantity("s", "stiffness foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    damping_prediction: Annotated[float, Quantity("s", "damping foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    command_age: Annotated[float, Quantity("periods", "command that moved the angle now seen", 1, 4, _N)]
    motor_decay: Annotated[float, Quantity("-", "what the motor's lag keeps over a period", 0.0, 1.0, _N)]
    J_moved: Annotated[float, Quantity("kg m2", "what the motor moves: J_pin, with J_s if stiff", 5e-4, 2.0, _N)]
    answer: Annotated[float, Quantity("-", "share of the hand's answer at once", 0.0, 1.0, "1 if stiff")]
    disturbance_rate: Annotated[float, Quantity("N m/s", "L, of what is unknown", 1e-3, 1e5, "0.3 rad/s c_fric")]
    fastest: Annotated[float, Quantity("1/s", "fastest local pole", 0.1, 1e3, "assumption: 0.01 to 0.105 / T_d")]
    slope: Annotated[float, Quantity("1/s", "of the surface, admittance", 0.0, 1e3, "assumption: 0.036 or 0.14 / T_d")]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    lead: Annotated[float, Quantity("s", "D over the whole torque", 0.0, 0.2, "computed from the plant")]
    lead_bandwidth: Annotated[float, Quantity("rad/s", "its filter", 1.0, 1e4, "assumption: 1.5 / T_d, 0.35 if stiff")]
    torque_lag: Annotated[float, Quantity("s", "lag of the hand's torque, admittance", 0.0, 0.1, "1.5 T_d if notched")]
    damping_share: Annotated[float, Quantity("-", "of -b_ref put back, admittance", 0.0, 10.0, "assumption")] = 1.5
    gain: Annotated[float, Quantity("-", "share of the matched gain", 0.0, 3.0, "assumption: 1")] = 1.0
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.2
    notch: Notch = Notch()


class TwistState(NamedTuple):
    """Algorithm's integral v, integral of the torque error in N m s, torques in N m, motion, notch."""

    twist: float = 0.0
    surface: float = 0.0
    torque: float = 0.0
    commanded: float = 0.0
    motion: MotionState = MotionState()
    notch: NotchState = NotchState()


@scalar
def was_cut(o: Observation, x: TwistState) -> bool:
    """Whether a limit of the motor cut the last command."""
    return abs(o.last_torque_1 - x.commanded) > CUT


@scalar
def equivalent(
    target: Target, lead: float, felt: Felt, o: Observation, x: TwistState, p: TwistParameters
) -> tuple[float, float]:
    """(Lower-body torque in N m that a known world needs, filtered torque in N m); ``lead`` in s."""
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    fast = lead * p.lead_bandwidth * (o.torsion_bar_torque - torque)
    proportional = gain_at(felt, p) * (target.wanted - o.torsion_bar_torque)
    return target.model + target.known - target.wanted - proportional + fast, torque


@scalar
def torque_law(o: Observation, x: TwistState, p: TwistParameters) -> tuple[float, TwistState]:
    """Impedance: the integral of the torque error slides."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    target = torque_target(o, felt, motion, p)
    total = 1.0 + gain_at(felt, p)
    cut = was_cut(o, x)
    s = x.surface if cut else x.surface + p.period * (target.wanted - o.torsion_bar_torque)
    u, twist = twist_step(s, x.twist, MARGIN * p.disturbance_rate / total, p.fastest, p.period)
    known, torque = equivalent(target, total * p.lead, felt, o, x, p)
    output, notch = notch_step(known + total * u, x.notch, p.notch)
    command = output / p.motor_ratio
    return command, TwistState(x.twist if cut else twist, s, torque, command, motion, notch)


@scalar
def angle_law(o: Observation, x: TwistState, p: TwistParameters) -> tuple[float, TwistState]:
    """Admittance: angle error and its rate slide."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    target = pulled_target(0.0, o, felt, motion, p)
    steepness = assist_slope(o.torsion_bar_torque, felt)
    inertia = 1.0 / (p.answer * steepness / felt.J_ref + 1.0 / p.J_moved)
    s = o.pinion_rate - o.reference_rate + p.slope * (o.pinion_angle - o.reference)
    u, twist = twist_step(s, x.twist, MARGIN * p.disturbance_rate / inertia, p.fastest, p.period)
    yielded = p.rack_share * steep_share(steepness, p)
    lead = loop_gain(o, felt, p) * p.lead + p.torque_lag
    known, torque = equivalent(target, lead, felt, o, x, p)
    damping = p.damping_share * max(-felt.b_ref, 0.0) / steepness * o.pinion_rate
    output, notch = notch_step(known + (1.0 - yielded) * (inertia * u - damping), x.notch, p.notch)
    command = output / p.motor_ratio
    return command, TwistState(x.twist if was_cut(o, x) else twist, 0.0, torque, command, motion, notch)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of TwistParameters."""
    s = plant.steering

    def for_period(period: float) -> TwistParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        poles = {"impedance": 0.02 if stiff else 0.01, "admittance": 0.105 if stiff else 0.08}
        parameters = TwistParameters(
            **hardware_of(plant, reference, period),
            J_moved=s.J_pin + (s.J_s if stiff else 0.0),
            answer=1.0 if stiff else 0.0,
            disturbance_rate=UNKNOWN_RATE * s.c_fric,
            fastest=poles[causality] / delay,
            slope=(0.036 if stiff else 0.14) / delay,
            acceleration_bandwidth=1.0 / delay,
            lead=0.0 if stiff else 1.5 * delay,
            lead_bandwidth=(0.35 if stiff else 1.5) / delay,
            torque_lag=1.5 * delay if stiff else 0.0,
            notch=notch,
        )
        return with_gains(parameters, gains, "super_twisting")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, TwistState())
