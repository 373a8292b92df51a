"""Super-twisting."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from controllers.blocks import Notch, NotchState, assist_slope, low_pass, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.schedule import Felt, felt_at
from controllers.tracking import MotionState, Target, gain_at, motion_step, pulled_target, torque_target
from controllers.twisting import MARGIN, twist_step
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
CUT = 1e-3  # N m at the motor: a command cut by more than this met a limit, not a rounding
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
}


class TwistParameters(NamedTuple):
    """Parameters of the three laws; torques at the lower body unless said otherwise."""

    schedule: Any  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction that is compensated", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    c_tb: Annotated[float, Quantity("N m/rad", "torsion-bar stiffness", 10.0, 5e4, _N)]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    disturbance_rate: Annotated[float, Quantity("N m/s", "L", 0.0, 1e5, "assumption")]
    fastest: Annotated[float, Quantity("1/s", "fastest pole of the reaching", 0.1, 1e3, "assumption")]
    slope: Annotated[float, Quantity("1/s", "slope of the sliding surface", 0.0, 1e3, "assumption")]
    lead: Annotated[float, Quantity("s", "zero of the lead: 1 / lead", 0.0, 0.2, "computed from the plant")]
    lead_bandwidth: Annotated[float, Quantity("rad/s", "pole of the lead", 1.0, 1e4, "assumption: 1.5 / T_d")]
    torque_lag: Annotated[float, Quantity("s", "lag of the hand's torque, admittance", 0.0, 0.1, "1.2 T_d if notched")]
    target_rate: Annotated[float, Quantity("-", "share of the target's rate in the surface", 0.0, 1.0, "assumption")]
    gain: Annotated[float, Quantity("-", "share of the matched gain", 0.0, 3.0, "assumption: 1")] = 1.0
    J_free: Annotated[float, Quantity("-", "x", 0.0, 10.0, "assumption")] = 0.0
    A: Annotated[float, Quantity("-", "x", 0.0, 10.0, "assumption")] = 1.0
    B: Annotated[float, Quantity("-", "x", 0.0, 10.0, "assumption")] = 1.0
    lack: Annotated[float, Quantity("-", "x", 0.0, 10.0, "assumption")] = 0.0
    damp: Annotated[float, Quantity("-", "x", 0.0, 10.0, "assumption")] = 0.0
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.3
    slope_limit: Annotated[float, Quantity("-", "slope beyond which a_ref fades", 1.0, 50.0, "assumption")] = 12.0
    notch: Notch = Notch()


class TwistState(NamedTuple):
    twist: float = 0.0
    surface: float = 0.0
    torque: float = 0.0
    wanted: float = 0.0
    commanded: float = 0.0
    motion: MotionState = MotionState()
    notch: NotchState = NotchState()


@scalar
def torque_law(o: Observation, x: TwistState, p: TwistParameters) -> tuple[float, TwistState]:
    """Impedance: s = integral of e."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    target = torque_target(o, felt, motion, p)
    gain = gain_at(felt, p)
    limited = abs(o.last_torque_1 - x.commanded) > CUT
    s = x.surface if limited else x.surface + p.period * (target.wanted - o.torsion_bar_torque)
    u, twist = twist_step(s, x.twist, MARGIN * p.disturbance_rate, p.fastest, p.period)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    wanted = low_pass(x.wanted, target.wanted, p.lead_bandwidth, p.period)
    rate = p.lead_bandwidth * (o.torsion_bar_torque - torque - p.target_rate * (target.wanted - wanted))
    fast = (1.0 + gain) * p.lead * rate
    lower = target.model + target.known - target.wanted - gain * (target.wanted - o.torsion_bar_torque) + fast
    lower = lower + (1.0 + gain) * u
    output, notch = notch_step(lower, x.notch, p.notch)
    command = output / p.motor_ratio
    return command, TwistState(x.twist if limited else twist, s, torque, wanted, command, motion, notch)


@scalar
def angle_law(o: Observation, x: TwistState, p: TwistParameters) -> tuple[float, TwistState]:
    """Admittance: s = e' + slope e."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    limited = abs(o.last_torque_1 - x.commanded) > CUT
    s = o.pinion_rate - o.reference_rate + p.slope * (o.pinion_angle - o.reference)
    u, twist = twist_step(s, x.twist, MARGIN * p.disturbance_rate / p.J_pin, p.fastest, p.period)
    slope = assist_slope(o.torsion_bar_torque, felt)
    inertia = 1.0 / (p.A * slope / felt.J_ref + p.B / p.J_free)
    target = pulled_target(0.0, o, felt, motion, p)
    gain = gain_at(felt, p)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    lead = min(slope, p.slope_limit) * p.lead + p.torque_lag + p.lack * max(-felt.b_ref, 0.0) / p.c_tb
    fast = lead * p.lead_bandwidth * (o.torsion_bar_torque - torque)
    lower = target.model + target.known - target.wanted - gain * (target.wanted - o.torsion_bar_torque) + fast
    lower = lower + inertia * u
    lower = lower - p.damp * max(-felt.b_ref, 0.0) / slope * o.pinion_rate
    output, notch = notch_step(lower, x.notch, p.notch)
    command = output / p.motor_ratio
    return command, TwistState(x.twist if limited else twist, 0.0, torque, 0.0, command, motion, notch)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    def for_period(period: float) -> TwistParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        parameters = TwistParameters(
            **hardware_of(plant, reference, period),
            c_tb=plant.steering.c_tb,
            acceleration_bandwidth=1.0 / delay,
            disturbance_rate=50.0,
            fastest=(0.02 if causality == "impedance" else 0.04)/delay,
            slope=(0.05/delay if causality == "impedance" else 0.04/delay),
            target_rate=0.0, J_free=plant.steering.J_pin+plant.steering.J_s*(1.0-plant.rack_share),
            lead=0.0 if stiff else 1.5 * delay,
            lead_bandwidth=(1.0 / 1.2 if stiff else 1.5) / delay,
            torque_lag=1.2 * delay if stiff else 0.0,
            notch=notch,
        )
        return with_gains(parameters, gains, "super_twisting")

    if causality == "admittance":
        law = angle_law
    else:
        law = torque_law
    return LawController(law, for_period, TwistState())
