"""LQG: Kalman filter on measured torque and angle, delay bridged by known commands, integral action.

The filter follows the plant at the time of the sensors: two bodies on their torsion bar, the
motor's lag, and two torques that wander, the hand's and what is not known of the load. From there
it is carried on with the commands that are under way (the delay's states, known without noise) to
the moment at which the next command will act. The gain is the LQ optimum for the twist of the bar,

    sum (M_tb - M_wanted)^2 + (corner integral)^2 + (command / effort)^2,

around the feed-forward of the reference; the filter's unknown load is taken off as it is. M_wanted
is the reference torque (impedance) or what brings the angle back (controllers.tracking).
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from controllers.blocks import Notch, NotchState, notch_step
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.kalman import Estimate
from controllers.law import Gain, LawController, with_gains
from controllers.lqg_design import Design, design
from controllers.schedule import Schedule, felt_at
from controllers.tracking import MotionState, Target, angle_target, motion_step, torque_target
from controllers.twist import deviation, estimated
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
CUT = 1e-3  # N m at the motor: a command cut by more than this met a limit, not a rounding
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "prediction": (0.3, 3.0),
    "damping_prediction": (0.3, 4.0),
    "effort": (0.2, 5.0),
    "corner": (0.1, 10.0),
    "hand": (0.1, 10.0),
    "load": (0.1, 10.0),
    "acceleration_bandwidth": (0.3, 2.0),
    "target_bandwidth": (0.4, 3.0),
    "rate_share": (0.2, 2.0),
    "natural": (0.4, 3.0),
    "damping_ratio": (0.4, 2.0),
    "inertia_share": (0.3, 3.0),
    "slope_limit": (0.4, 3.0),
}


class LqgParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    step: Any  # float64 [7, 9]: Estimate one period on from (Estimate, motor target, known load)
    correction: Any  # float64 [7, 2]: Kalman gain on torque and angle
    outputs: Any  # float64 [2, 7]
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
    c_tb: Annotated[float, Quantity("N m/rad", "torsion-bar stiffness", 10.0, 5e4, _N)]
    periods_ahead: Annotated[float, Quantity("periods", "from the sensors to the command's action", 0, 4, _N)]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    natural: Annotated[float, Quantity("rad/s", "return of the angle", 0.1, 500.0, "assumption: 0.075 / T_d")]
    target_bandwidth: Annotated[float, Quantity("rad/s", "lag of the target", 1.0, 1e4, "assumption: 0.8 / T_d")]
    target_lag: Annotated[float, Quantity("-", "share of lagged target, admittance", 0.0, 1.0, "1 where notched")]
    K_twist: Annotated[float, Quantity("-", "LQ gain", -1e6, 1e6, "LQ")]
    K_rate: Annotated[float, Quantity("-", "LQ gain", -1e6, 1e6, "LQ")]
    K_motor: Annotated[float, Quantity("-", "LQ gain", -1e3, 1e3, "LQ")]
    K_integral: Annotated[float, Quantity("1/s", "LQ gain", -1e6, 1e6, "LQ")]
    effort: Annotated[float, Quantity("-", "command per torque error, the weight of the LQ", 0.01, 1e3, "assumption")]
    corner: Annotated[float, Quantity("1/s", "weight of the integral; 0: none", 0.0, 1e3, "assumption")]
    hand: Annotated[float, Quantity("N m/s", "wander of the hand's torque, per root s", 0.01, 1e5, "assumption")]
    load: Annotated[float, Quantity("N m/s", "wander of the unknown load, per root s", 0.01, 1e5, "assumption")]
    rate_share: Annotated[float, Quantity("-", "share of the target's rate", 0.0, 1.0, "assumption")] = 0.5
    gain: Annotated[float, Quantity("-", "for the target's inertia", 0.0, 3.0, "assumption")] = 1.0
    damping_ratio: Annotated[float, Quantity("-", "of the angle's return", 0.0, 3.0, "assumption")] = 0.9
    inertia_share: Annotated[float, Quantity("-", "share of J_pin cancelled outright", 0.0, 1.0, "assumption")] = 0.3
    notch: Notch = Notch()


class LqgState(NamedTuple):
    """Estimate; lagged target, last command and past known loads in N m, integral of the error in N m s."""

    estimate: Estimate = Estimate()
    slow: float = 0.0
    integral: float = 0.0
    commanded: float = 0.0
    known_1: float = 0.0
    known_2: float = 0.0
    known_3: float = 0.0
    motion: MotionState = MotionState()
    notch: NotchState = NotchState()


@scalar
def lqg_loop(
    target: Target,
    known: float,
    signal: float,
    lagged: float,
    motion: MotionState,
    o: Observation,
    x: LqgState,
    p: LqgParameters,
) -> tuple[float, LqgState]:
    """Motor torque for a target; ``known`` is the load in N m at the time of the sensors."""
    seen, then = estimated(o, x.estimate, known, p)
    limited = abs(o.last_torque_1 - x.commanded) > CUT
    integral = x.integral if limited else x.integral + p.period * (target.wanted - o.torsion_bar_torque)
    d = deviation(target, signal, lagged, x.slow, seen, then, p)
    feedback = p.K_twist * d.twist + p.K_rate * d.twist_rate
    feedback = feedback + p.K_motor * d.motor_torque - p.K_integral * integral
    command, notch = notch_step(d.forward - feedback, x.notch, p.notch)
    return command, LqgState(seen, d.slow, integral, command, target.known, x.known_1, x.known_2, motion, notch)


@scalar
def torque_law(o: Observation, x: LqgState, p: LqgParameters) -> tuple[float, LqgState]:
    """Impedance: the reference torque at the measured motion."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.pinion_angle, o, felt, x.motion, p)
    target = torque_target(o, felt, motion, p)
    return lqg_loop(target, target.known, target.wanted, 0.0, motion, o, x, p)


@scalar
def angle_law(o: Observation, x: LqgState, p: LqgParameters) -> tuple[float, LqgState]:
    """Admittance: the reference torque that brings the angle back."""
    felt = felt_at(o.speed, p.schedule)
    motion = motion_step(o.reference, o, felt, x.motion, p)
    return lqg_loop(angle_target(o, felt, motion, p), x.known_3, o.torsion_bar_torque, p.target_lag, motion, o, x, p)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of LqgParameters."""
    s = plant.steering

    def for_period(period: float) -> LqgParameters:
        delay = total_delay(plant, period)
        notch = bar_notch(plant, period)
        active = causality == "impedance" and notch == Notch()
        weights = {name: gains[name] for name in Design._fields if name in gains}
        chosen, found = design(plant, causality, period, delay, weights)
        parameters = LqgParameters(
            **hardware_of(plant, reference, period),
            c_tb=s.c_tb,
            periods_ahead=min(plant.sensors.angle_delay + plant.motor.dead_time, 3.0),
            acceleration_bandwidth=0.5 / delay if active else 1.0 / delay,
            natural=0.075 / delay,
            target_bandwidth=0.25 / delay if active else 1.0 / (1.2 * delay),
            target_lag=0.0 if notch == Notch() else 1.0,
            notch=notch,
            **chosen._asdict(),
            **found,
        )
        return with_gains(parameters, {k: v for k, v in gains.items() if k not in weights}, "lqg")

    return LawController(torque_law if causality == "impedance" else angle_law, for_period, LqgState())
