"""Linear MPC: the twist of the torsion bar over a horizon, the motor's torque and slew limits as constraints.

Estimate, bridge over the delay and targets are lqg's (controllers.twist, controllers.tracking); what
differs is what follows. Each period the motor's commands over the next 9 periods are chosen that
cost least,

    sum (M_tb - M_wanted)^2 + ((command - held) / effort)^2,

by a model of the bar and the motor, among those that the motor can follow: none beyond its rated
torque, no change faster than its slew rate (controllers.mpc_design has the programme, mpc_moves its
solution). The first is given out. There is no integral that a limit could wind up: the filter's
unknown load is taken off, and the filter knows the commands as they were limited.

What knowing the limits is worth: on the law's own model much (tests/controllers/test_mpc.py), in a
loop with arm and reference next to nothing against the same law cut by the motor, for the aim, which
the plan takes as held, follows the hand. At a slew rate of 3 % of the EPAS motor's, in impedance, the
plan does worse than the cut.

Where the bar's mode is too fast for active damping, a notch takes it out of all that the programme
starts from, so that the limits still hold for the command itself.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from controllers.blocks import Notch, NotchState, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.kalman import Estimate
from controllers.law import Gain, LawController, with_gains
from controllers.mpc_design import Design, design
from controllers.mpc_moves import next_command
from controllers.schedule import Schedule, felt_at
from controllers.tracking import MotionState, Target, angle_target, motion_step, torque_target
from controllers.twist import deviation, estimated
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# Bandwidth of the lagged target times T_d, by causality and whether the bar is too stiff for active damping.
BANDWIDTH = {
    ("impedance", False): 0.25,
    ("impedance", True): 0.8,
    ("admittance", False): 0.8,
    ("admittance", True): 0.42,
}
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "effort": (0.2, 5.0),
    "hand": (0.1, 10.0),
    "load": (0.1, 10.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "target_bandwidth": (0.4, 3.0),
    "rate_share": (0.2, 2.0),
    "natural": (0.4, 3.0),
    "damping_ratio": (0.4, 2.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 2.5),
}


class MpcParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    step: Any  # float64 [7, 9]: Estimate one period on from (Estimate, motor target, known load)
    correction: Any  # float64 [7, 2]: Kalman gain on torque and angle
    outputs: Any  # float64 [2, 7]
    H: Any  # float64 [n, n] and so on: mpc_design.Programme of n moves
    slopes: Any  # float64 [n, 3]
    best: Any  # float64 [n, 3]
    increments: Any  # float64 [n, n]
    spans: Any  # float64 [n]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    rated_torque: Annotated[float, Quantity("N m", "limit of the command, at the motor", 0.01, 50.0, _N)]
    slew_rate: Annotated[float, Quantity("N m/s", "fastest change of the command", 1.0, 1e6, _N)]
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
    c_tb: Annotated[float, Quantity("N m/rad", "torsion-bar stiffness", 10.0, 5e4, _N)]
    periods_ahead: Annotated[float, Quantity("periods", "from the sensors to the command's action", 0, 4, _N)]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    natural: Annotated[float, Quantity("rad/s", "return of the angle", 0.1, 500.0, "assumption: 0.19 / T_d")]
    target_bandwidth: Annotated[float, Quantity("rad/s", "lag of the target", 1.0, 1e4, "assumption: BANDWIDTH / T_d")]
    target_lag: Annotated[float, Quantity("-", "share of lagged target, admittance", 0.0, 1.0, "1 where notched")]
    rate_share: Annotated[float, Quantity("-", "share of the target's rate", 0.0, 1.0, "assumption")]
    effort: Annotated[float, Quantity("-", "command per torque error, a weight", 0.01, 1e3, "assumption")]
    hand: Annotated[float, Quantity("N m/s", "wander of the hand's torque, per root s", 0.01, 1e5, "assumption")]
    load: Annotated[float, Quantity("N m/s", "wander of the unknown load, per root s", 0.01, 1e5, "assumption")]
    gain: Annotated[float, Quantity("-", "for the target's inertia", 0.0, 3.0, "assumption")] = 1.0
    damping_ratio: Annotated[float, Quantity("-", "of the angle's return", 0.0, 3.0, "assumption")] = 0.9
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.3
    notch: Notch = Notch()


class MpcState(NamedTuple):
    """Estimate; lagged target and past known loads in N m; active limits (mpc_moves); motion, notches."""

    estimate: Estimate = Estimate()
    slow: float = 0.0
    active: float = 0.0
    known_1: float = 0.0
    known_2: float = 0.0
    known_3: float = 0.0
    motion: MotionState = MotionState()
    forward: NotchState = NotchState()
    twist: NotchState = NotchState()
    twist_rate: NotchState = NotchState()
    motor_torque: NotchState = NotchState()


@scalar
def mpc_loop(
    target: Target,
    known: float,
    signal: float,
    lagged: float,
    motion: MotionState,
    o: Observation,
    x: MpcState,
    p: MpcParameters,
) -> tuple[float, MpcState]:
    """Motor torque for a target; ``known`` is the load in N m at the time of the sensors."""
    seen, then = estimated(o, x.estimate, known, p)
    d = deviation(target, signal, lagged, x.slow, seen, then, p)
    forward, n_forward = notch_step(d.forward, x.forward, p.notch)
    twist, n_twist = notch_step(d.twist, x.twist, p.notch)
    twist_rate, n_rate = notch_step(d.twist_rate, x.twist_rate, p.notch)
    motor_torque, n_motor = notch_step(d.motor_torque, x.motor_torque, p.notch)
    command, active = next_command(forward, o.last_torque_1, twist, twist_rate, motor_torque, x.active, p)
    notches = n_forward, n_twist, n_rate, n_motor
    return command, MpcState(seen, d.slow, active, target.known, x.known_1, x.known_2, motion, *notches)


@scalar
def torque_law(o: Observation, x: MpcState, p: MpcParameters) -> tuple[float, MpcState]:
    """Impedance: the reference torque at the measured motion."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    target = torque_target(o, felt, motion, p)
    return mpc_loop(target, target.known, target.wanted, 0.0, motion, o, x, p)


@scalar
def angle_law(o: Observation, x: MpcState, p: MpcParameters) -> tuple[float, MpcState]:
    """Admittance: the reference torque that brings the angle back."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    return mpc_loop(angle_target(o, felt, motion, p), x.known_3, o.torsion_bar_torque, p.target_lag, motion, o, x, p)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of MpcParameters."""
    s, motor = plant.steering, plant.motor

    def for_period(period: float) -> MpcParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        stiff = notch != Notch()
        weights = {name: gains[name] for name in Design._fields if name in gains}
        chosen, found = design(plant, causality, period, weights)
        calm = causality == "impedance" and not stiff
        parameters = MpcParameters(
            **hardware_of(plant, reference, period),
            rated_torque=motor.rated_torque,
            slew_rate=motor.slew_rate,
            c_tb=s.c_tb,
            periods_ahead=min(plant.sensors.angle_delay + motor.dead_time, 3.0),
            acceleration_bandwidth=0.5 / delay if calm else 1.0 / delay,
            natural=0.19 / delay,
            target_bandwidth=BANDWIDTH[causality, stiff] / delay,
            target_lag=1.0 if stiff else 0.0,
            rate_share=0.5 if causality == "impedance" else 0.1,
            notch=notch,
            **chosen._asdict(),
            **found,
        )
        return with_gains(parameters, {k: v for k, v in gains.items() if k not in weights}, "mpc")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, MpcState())
