"""Disturbance observer with PD and reference feed-forward; the Q-filter's bandwidth is the tuning axis.

The observer compares what the lower body does with what its nominal model should do under the
motor's and the hand's torque, and gives the difference back to the motor:

    d = M_tb + i M_mot - J_pin a - b_pin w - M_known,     i M_mot = M_model + M_known + Q(s) d - M_wanted + PD

M_known is what feed-forward already knows of load and friction. What the model gets wrong (the
car's load, friction, motor constant) appears in d and is gone below Q's bandwidth. Above it nothing
changes; it cannot be raised beyond what the delay allows. M_mot comes from the commands, aged by
the delays and the motor's lag as the angle is. The acceleration comes from the control unit's own
observer, whose unknown load is a triple lag of the true one; M_known takes the same lag before the
two are compared, or its lead over them would look like a disturbance.

Impedance: P and D on the torsion-bar torque. Admittance: P and D on the angle, as a torque by the
reference's own inertia and assist (controllers.tracking).
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from controllers.blocks import Notch, NotchState, low_pass, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.pid import load_seen
from controllers.schedule import Felt, Schedule, felt_at
from controllers.tracking import (
    MotionState,
    Target,
    angle_target,
    gain_at,
    loop_gain,
    motion_step,
    torque_target,
)
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "q_bandwidth": (0.1, 5.0),
    "gain": (0.3, 2.5),
    "derivative": (0.4, 2.0),
    "derivative_bandwidth": (0.5, 2.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "torque_lag": (0.5, 2.0),
    "natural": (0.4, 3.0),
    "damping_ratio": (0.4, 2.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 3.0),
}


class ObserverParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    slope_limit: Annotated[float, Quantity("-", "assist slope beyond which the angle yields", 1.0, 50.0, "assumption")]
    prediction: Annotated[float, Quantity("s", "stiffness foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    damping_prediction: Annotated[float, Quantity("s", "damping foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    command_age: Annotated[float, Quantity("periods", "command that moved the angle now seen", 1, 4, _N)]
    motor_decay: Annotated[float, Quantity("-", "what the motor's lag keeps over a period", 0.0, 1.0, _N)]
    observer_bandwidth: Annotated[float, Quantity("rad/s", "of the control unit's observer", 1.0, 2e3, _N)]
    q_bandwidth: Annotated[float, Quantity("rad/s", "Q filter; 0: none", 0.0, 1e3, "assumption: 0.1 / T_d")]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    derivative: Annotated[float, Quantity("s", "D over P on the torque", 0.0, 0.2, "computed from the plant")]
    derivative_bandwidth: Annotated[float, Quantity("rad/s", "its filter", 1.0, 1e4, "assumption: 1.5 / T_d")]
    natural: Annotated[float, Quantity("rad/s", "angle loop", 0.1, 500.0, "assumption: 0.075 / T_d")]
    torque_lag: Annotated[float, Quantity("s", "lag of the hand's torque, admittance", 0.0, 0.1, "1.2 T_d if notched")]
    gain: Annotated[float, Quantity("-", "share of the matched torque gain", 0.0, 3.0, "assumption")] = 1.0
    damping_ratio: Annotated[float, Quantity("-", "of the angle loop", 0.0, 3.0, "assumption")] = 0.9
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.3
    notch: Notch = Notch()


class ObserverState(NamedTuple):
    """Disturbance, lags of what is known and filtered torque in N m; motion, notch."""

    disturbance: float = 0.0
    known_1: float = 0.0
    known_2: float = 0.0
    known_3: float = 0.0
    torque: float = 0.0
    motion: MotionState = MotionState()
    notch: NotchState = NotchState()


@scalar
def disturbance_of(
    known: float, motion: MotionState, o: Observation, x: ObserverState, p: ObserverParameters
) -> tuple[float, float, float, float]:
    """(Q(s) d, the three lags of ``known``), all in N m; ``known`` is load and friction."""
    known_1 = low_pass(x.known_1, known, p.observer_bandwidth, p.period)
    known_2 = low_pass(x.known_2, known_1, p.observer_bandwidth, p.period)
    known_3 = low_pass(x.known_3, known_2, p.observer_bandwidth, p.period)
    seen = load_seen(o, motion.motor_torque, known_3, p)
    return low_pass(x.disturbance, seen, p.q_bandwidth, p.period), known_1, known_2, known_3


@scalar
def pd_loop(
    target: Target,
    lead: float,
    motion: MotionState,
    felt: Felt,
    o: Observation,
    x: ObserverState,
    p: ObserverParameters,
) -> tuple[float, ObserverState]:
    """Motor torque for a target; ``lead`` in s is D over the whole torque."""
    disturbance, known_1, known_2, known_3 = disturbance_of(target.known, motion, o, x, p)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.derivative_bandwidth, p.period)
    derivative = lead * p.derivative_bandwidth * (o.torsion_bar_torque - torque)
    proportional = gain_at(felt, p) * (target.wanted - o.torsion_bar_torque)
    lower = target.model + target.known + disturbance - target.wanted - proportional + derivative
    output, notch = notch_step(lower, x.notch, p.notch)
    state = ObserverState(disturbance, known_1, known_2, known_3, torque, motion, notch)
    return output / p.motor_ratio, state


@scalar
def torque_law(o: Observation, x: ObserverState, p: ObserverParameters) -> tuple[float, ObserverState]:
    """Impedance: reference torque fed forward, PD on the torque, disturbance taken off."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    lead = (1.0 + gain_at(felt, p)) * p.derivative
    return pd_loop(torque_target(o, felt, motion, p), lead, motion, felt, o, x, p)


@scalar
def angle_law(o: Observation, x: ObserverState, p: ObserverParameters) -> tuple[float, ObserverState]:
    """Admittance: reference motion fed forward, PD on the angle, disturbance taken off."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    lead = loop_gain(o, felt, p) * p.derivative + p.torque_lag
    return pd_loop(angle_target(o, felt, motion, p), lead, motion, felt, o, x, p)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of ObserverParameters."""

    def for_period(period: float) -> ObserverParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        parameters = ObserverParameters(
            **hardware_of(plant, reference, period),
            observer_bandwidth=2.0 * math.pi * plant.observer_bandwidth_Hz,
            q_bandwidth=0.1 / delay,
            acceleration_bandwidth=1.0 / delay,
            derivative=0.0 if stiff else 1.5 * delay,
            derivative_bandwidth=(1.0 / 1.2 if stiff else 1.5) / delay,
            natural=0.075 / delay,
            torque_lag=1.2 * delay if stiff else 0.0,
            notch=notch,
        )
        return with_gains(parameters, gains, "disturbance_observer")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, ObserverState())
