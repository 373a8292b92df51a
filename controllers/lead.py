"""Lead-lag compensated torsion-bar torque loop around the boost, the classic of EPAS.

    i M_mot = M_model + M_load - M_wanted - C(s) (M_wanted - M_tb)
    C(s) = (1 + gain) (1 + lag w / (s + w) + lead s / (1 + s / v)) - 1

M_load - M_wanted is the boost that the reference asks for, M_model what the nominal lower body
takes. The lead sits on the measured torque alone (a target that holds an acceleration is too noisy
for it) and damps the torsion-bar mode; the lag multiplies the gain where steering is slow, without
an integral and so without winding up.

Impedance: M_wanted is the reference torque. Admittance: the same loop gets the torque of the
reference at the motion that would bring the angle back (controllers.tracking), so that the torque
loop, which the arm hardly changes, does the work. A torque flange (steer-by-wire) is too stiff for
a lead behind the delay: there the mode is notched and the lag is what remains of the loop.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.blocks import Notch, NotchState, low_pass, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.schedule import Felt, Schedule, felt_at
from controllers.tracking import MotionState, Target, angle_target, gain_at, loop_gain, motion_step, torque_target
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "gain": (0.3, 2.5),
    "lead": (0.4, 2.0),
    "lead_bandwidth": (0.5, 2.0),
    "lag": (0.1, 5.0),
    "lag_bandwidth": (0.2, 20.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "torque_lag": (0.5, 2.0),
    "natural": (0.4, 3.0),
    "damping_ratio": (0.4, 2.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 3.0),
}


class LeadParameters(NamedTuple):
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
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    lead: Annotated[float, Quantity("s", "zero of the lead: 1 / lead", 0.0, 0.2, "computed from the plant")]
    lead_bandwidth: Annotated[float, Quantity("rad/s", "pole of the lead", 1.0, 1e4, "assumption: 1.5 / T_d")]
    lag_bandwidth: Annotated[float, Quantity("rad/s", "pole of the lag", 0.01, 1e3, "assumption: 0.005 / T_d")]
    natural: Annotated[float, Quantity("rad/s", "return of the angle", 0.1, 500.0, "assumption: 0.075 / T_d")]
    torque_lag: Annotated[float, Quantity("s", "lag of the hand's torque, admittance", 0.0, 0.1, "1.2 T_d if notched")]
    lag: Annotated[float, Quantity("-", "slow gain over fast gain, less 1", 0.0, 100.0, "assumption")] = 1.0
    gain: Annotated[float, Quantity("-", "share of the matched gain", 0.0, 3.0, "assumption: 1")] = 1.0
    damping_ratio: Annotated[float, Quantity("-", "of the angle's return", 0.0, 3.0, "assumption")] = 0.9
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.3
    notch: Notch = Notch()


class LeadState(NamedTuple):
    """Filtered torque and slow torque error in N m, motion, notch."""

    torque: float = 0.0
    slow_error: float = 0.0
    motion: MotionState = MotionState()
    notch: NotchState = NotchState()


@scalar
def torque_loop(
    target: Target, lead: float, motion: MotionState, felt: Felt, o: Observation, x: LeadState, p: LeadParameters
) -> tuple[float, LeadState]:
    """Motor torque for a target; ``lead`` in s of the whole torque."""
    gain = gain_at(felt, p)
    error = target.wanted - o.torsion_bar_torque
    slow = low_pass(x.slow_error, error, p.lag_bandwidth, p.period)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    fast = lead * p.lead_bandwidth * (o.torsion_bar_torque - torque)
    lower = target.model + target.known - target.wanted - gain * error - (1.0 + gain) * p.lag * slow + fast
    output, notch = notch_step(lower, x.notch, p.notch)
    return output / p.motor_ratio, LeadState(torque, slow, motion, notch)


@scalar
def torque_law(o: Observation, x: LeadState, p: LeadParameters) -> tuple[float, LeadState]:
    """Impedance: boost from the measured motion, lead-lag on the torque error."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    lead = (1.0 + gain_at(felt, p)) * p.lead
    return torque_loop(torque_target(o, felt, motion, p), lead, motion, felt, o, x, p)


@scalar
def angle_law(o: Observation, x: LeadState, p: LeadParameters) -> tuple[float, LeadState]:
    """Admittance: reference motion fed forward, angle error as a torque, lead-lag on that."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    lead = loop_gain(o, felt, p) * p.lead + p.torque_lag
    return torque_loop(angle_target(o, felt, motion, p), lead, motion, felt, o, x, p)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of LeadParameters."""

    def for_period(period: float) -> LeadParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        parameters = LeadParameters(
            **hardware_of(plant, reference, period),
            acceleration_bandwidth=1.0 / delay,
            lead=0.0 if stiff else 1.5 * delay,
            lead_bandwidth=(1.0 / 1.2 if stiff else 1.5) / delay,
            lag_bandwidth=0.005 / delay,
            natural=0.075 / delay,
            torque_lag=1.2 * delay if stiff else 0.0,
            notch=notch,
        )
        return with_gains(parameters, gains, "lead")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, LeadState())
