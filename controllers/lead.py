"""Lead-lag compensated torsion-bar torque loop around the boost, the classic of EPAS.

    i M_mot = M_model + M_load - M_wanted - C(s) (M_wanted - M_tb),   C = gain lead(s) + lag(s)

M_load - M_wanted is the boost that the reference asks for, M_model what the nominal lower body
takes. The lead sits on the measured torque alone (a target that holds an acceleration is too noisy
for it) and damps the torsion-bar mode; the lag multiplies the gain where steering is slow, without
an integral and so without winding up.

Impedance: M_wanted is the reference torque. Admittance: the same loop gets the torque of the
reference at the motion that would bring the angle back,

    M_eff,wanted = M_eff - J_ref (w^2 e + 2 z w e') - b_ref e'

so angle error turns into torque error by the reference's own inertia and assist, and the torque
loop, which the arm hardly changes, does the work. A torque flange (steer-by-wire) is too stiff for
a lead behind the delay: there the mode is notched and the lag is what remains of the loop.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from controllers.blocks import Notch, NotchState, assist_slope, low_pass, notch_step, torque_of
from controllers.law import LawController, with_gains
from controllers.pid import load_of
from controllers.pid_design import bar_notch, total_delay
from controllers.schedule import Felt, felt_at, schedule_of
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"


class LeadParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Any  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction that is compensated", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
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
    slope_limit: Annotated[float, Quantity("-", "slope beyond which a_ref fades", 1.0, 50.0, "assumption")] = (
        12.0
    )
    notch: Notch = Notch()


class LeadState(NamedTuple):
    """Filtered torque and slow torque error in N m, accelerations in rad/s2, frictions with their angles."""

    torque: float = 0.0
    slow_error: float = 0.0
    acceleration_1: float = 0.0
    acceleration_2: float = 0.0
    friction: float = 0.0
    friction_angle: float = 0.0
    felt_friction: float = 0.0
    felt_angle: float = 0.0
    notch: NotchState = NotchState()


@scalar
def gain_at(felt: Felt, p: LeadParameters) -> float:
    """Fast gain on the torque error: with 1 + gain = K J_pin / J_ref the hardware's inertia is felt as J_ref."""
    return p.gain * max((1.0 + felt.k_gain) * p.J_pin / felt.J_ref - 1.0, 0.0)


@scalar
def torque_loop(
    wanted: float, forward: float, felt: Felt, lead: float, angles: tuple[float, float, float, float],
    a_1: float, a_2: float, o: Observation, x: LeadState, p: LeadParameters,
) -> tuple[float, LeadState]:  # fmt: skip
    """Motor torque for a wanted torsion-bar torque; ``forward`` is what model and load take, in N m.

    ``lead`` in s; ``angles`` are friction and its angle, felt friction and its angle.
    """
    gain = gain_at(felt, p)
    error = wanted - o.torsion_bar_torque
    slow = low_pass(x.slow_error, error, p.lag_bandwidth, p.period)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    fast = lead * p.lead_bandwidth * (o.torsion_bar_torque - torque)
    lower = forward - wanted - gain * error - (1.0 + gain) * p.lag * slow + fast
    output, notch = notch_step(lower, x.notch, p.notch)
    state = LeadState(torque, slow, a_1, a_2, angles[0], angles[1], angles[2], angles[3], notch)
    return output / p.motor_ratio, state


@scalar
def torque_law(o: Observation, x: LeadState, p: LeadParameters) -> tuple[float, LeadState]:
    """Impedance: boost from the measured motion, lead-lag on the torque error."""
    felt = felt_at(o.speed, p.schedule)
    a_1 = low_pass(x.acceleration_1, o.pinion_acceleration, p.acceleration_bandwidth, p.period)
    a_2 = low_pass(x.acceleration_2, a_1, p.acceleration_bandwidth, p.period)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, o.pinion_angle - x.felt_angle, felt.M_fric_C, felt.c_fric)
    load = load_of(o, o.pinion_acceleration, o.pinion_rate, felt_friction, felt)
    # The wide-band acceleration would close a loop around the motor's own torque.
    wanted = torque_of(o.effective_torque - felt.J_ref * (o.pinion_acceleration - a_2), felt)
    # Off centre the felt inertia is small; cancelling more of the hardware's would leave a body
    # without inertia behind a delay.
    gain = gain_at(felt, p)
    felt_inertia = (1.0 + gain) * felt.J_ref / assist_slope(wanted, felt)
    inertia = min(p.J_pin, felt_inertia + p.inertia_share * p.J_pin)
    forward = inertia * a_2 + p.b_pin * o.pinion_rate + friction + p.rack_share * load
    angles = (friction, o.pinion_angle, felt_friction, o.pinion_angle)
    return torque_loop(wanted, forward, felt, (1.0 + gain) * p.lead, angles, a_1, a_2, o, x, p)


@scalar
def angle_law(o: Observation, x: LeadState, p: LeadParameters) -> tuple[float, LeadState]:
    """Admittance: reference motion fed forward, angle error as a torque, lead-lag on that."""
    felt = felt_at(o.speed, p.schedule)
    a_1 = low_pass(x.acceleration_1, o.pinion_acceleration, p.acceleration_bandwidth, p.period)
    a_2 = low_pass(x.acceleration_2, a_1, p.acceleration_bandwidth, p.period)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, o.reference - x.felt_angle, felt.M_fric_C, felt.c_fric)
    load = load_of(o, o.reference_acceleration, o.reference_rate, felt_friction, felt)
    error, error_rate = o.reference - o.pinion_angle, o.reference_rate - o.pinion_rate

    # Where the assist is steep the reference runs away from any motor behind a delay: its
    # acceleration is then no longer fed forward, but asked for as torque.
    slope = assist_slope(o.torsion_bar_torque, felt)
    steep = max(1.0 - p.slope_limit / slope, 0.0)
    pull = p.natural * p.natural * error + 2.0 * p.damping_ratio * p.natural * error_rate
    gap = felt.J_ref * (pull + steep * (o.reference_acceleration - a_2)) + felt.b_ref * steep * error_rate
    wanted = torque_of(o.effective_torque - gap, felt)
    acceleration = (1.0 - steep) * o.reference_acceleration + steep * p.inertia_share * a_2
    rate = (1.0 - steep) * o.reference_rate + steep * o.pinion_rate
    forward = p.J_pin * acceleration + p.b_pin * rate + friction + p.rack_share * load
    lead = min(slope, p.slope_limit) * p.lead + p.torque_lag
    angles = (friction, o.pinion_angle, felt_friction, o.reference)
    return torque_loop(wanted, forward, felt, lead, angles, a_1, a_2, o, x, p)


def make(plant: Plant, reference: Reference, causality: str, **gains: float) -> LawController:
    """The controller for a plant; ``gains`` replace fields of LeadParameters."""
    s = plant.steering

    def for_period(period: float) -> LeadParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        parameters = LeadParameters(
            schedule=schedule_of(reference),
            period=period,
            motor_ratio=s.motor_ratio,
            rack_share=plant.rack_share,
            J_pin=s.J_pin,
            b_pin=s.b_pin,
            M_fric=s.M_fric,
            c_fric=s.c_fric,
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
