"""H-infinity: a sampled mixed-sensitivity controller on angle error and sensed torque, robust to the driver's arm.

In the spirit of Chugh, Bruzelius and Kulcsar, Robust H-infinity Position Controller for Steering
Systems (arXiv 2412.19161): the sensed torsion-bar torque enters the position loop, the inertia of
the driver's arm is the uncertainty, and the loop gain is high at low and low at high frequency.

The law has two parts. The first knows the reference and the hardware and is not linear: it finds the
acceleration that the reference has under the measured torque and what the lower body needs for that,

    v_ff = J_pin a_ref + b_pin w + M_fric + share M_load - M_tb.

The second is linear, of ten states, the same at every speed and assist: v = K (e, v_ff) from the
angle error and the feed-forward, made by an H-infinity synthesis (h_infinity_plant: the weights;
synthesis: the solver; h_infinity_design: from gamma to a sampled law, ``parameters.achieved``).

Admittance: e is the reference angle less the measured one. Impedance: the reference's load is taken
at the measured motion, the acceleration that the torque then gives it is integrated twice, leaking
towards the measured motion, and e is what lies between: the torque error without an acceleration
in it.

Where the assist is steep, torque moves the reference faster than a motor behind a delay can follow.
The acceleration is therefore scaled down to that of ``least_inertia``; in admittance what is left out
comes back slowly (``return_rate``).
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np

from controllers.blocks import assist_slope, assisted
from controllers.h_infinity_design import Achieved, designed, felt_of
from controllers.h_infinity_plant import Weights
from controllers.hardware import hardware_of, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.pid import load_of
from controllers.schedule import Felt, felt_at
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.physics.linear import load_matrices
from steer_env.physics.reference import ReferenceParameters
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "felt_inertia": (0.5, 2.0),
    "accuracy": (0.3, 3.0),
    "natural": (0.3, 3.0),
    "bandwidth": (0.5, 2.0),
    "integral": (0.3, 3.0),
    "gain_error": (0.3, 3.0),
    "gain_bandwidth": (0.5, 2.0),
    "inertia_error": (0.5, 2.0),
    "load": (0.3, 3.0),
    "torque_noise": (0.3, 5.0),
    "least_inertia": (0.5, 2.0),
}


class HInfinityParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Any  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    instant: Any  # float64 [n]: stiffness of the reference's load at once, N m/rad, for each row
    step: Any  # float64 [10, 13]: linear part one period on from (its states, v, e, v_ff)
    output: Any  # float64 [13]: v from the same, without v
    achieved: Achieved
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    leak: Annotated[float, Quantity("1/s", "of the integrated acceleration, impedance", 0.0, 100.0, "assumption")]
    least_inertia: Annotated[float, Quantity("kg m2", "felt inertia that can be followed", 1e-4, 1.0, "assumption")]
    return_rate: Annotated[float, Quantity("rad/s", "return of what was left out", 0.0, 100.0, "assumption")]
    felt_inertia: Annotated[float, Quantity("kg m2", "of the design: J_ref over the assist's slope", 1e-3, 1.0, "a")]
    accuracy: Annotated[float, Quantity("-", "hand torque over torque error", 0.1, 1e4, "assumption")]
    natural: Annotated[float, Quantity("rad/s", "return of the angle", 0.1, 500.0, "assumption")]
    bandwidth: Annotated[float, Quantity("rad/s", "up to which the accuracy is asked for", 1.0, 1e3, "assumption")]
    integral: Annotated[float, Quantity("1/s", "weight of the integral", 0.0, 100.0, "assumption")]
    gain_error: Annotated[float, Quantity("-", "of the motor's path, slow", 1e-3, 0.99, "assumption")]
    gain_bandwidth: Annotated[float, Quantity("rad/s", "where that error is 1", 10.0, 3e3, "assumption")]
    inertia_error: Annotated[float, Quantity("-", "of the lower body", 1e-3, 0.99, "spread of the plant")]
    load: Annotated[float, Quantity("N m", "torque at the lower body, per N m of the hand", 1e-2, 100.0, "assumption")]
    angle_noise: Annotated[float, Quantity("rad", "noise", 1e-7, 0.1, "assumption")]
    torque_noise: Annotated[float, Quantity("N m", "noise", 1e-4, 10.0, "assumption")]
    late: Annotated[float, Quantity("s", "delay that the design counts with beyond the known one", 0.0, 0.1, "draws")]


class Inner(NamedTuple):
    """States of the linear part."""

    x0: float = 0.0
    x1: float = 0.0
    x2: float = 0.0
    x3: float = 0.0
    x4: float = 0.0
    x5: float = 0.0
    x6: float = 0.0
    x7: float = 0.0
    x8: float = 0.0
    x9: float = 0.0


class HInfinityState(NamedTuple):
    """Linear part; its last inputs (rad, N m); reference motion of the law's own; frictions with their angles."""

    inner: Inner = Inner()
    error: float = 0.0
    forward: float = 0.0
    angle: float = 0.0
    rate: float = 0.0
    ahead: float = 0.0
    friction: float = 0.0
    friction_angle: float = 0.0
    felt_friction: float = 0.0
    felt_angle: float = 0.0
    then_friction: float = 0.0
    then_angle: float = 0.0


@scalar
def _row(i: int, v: float, x: HInfinityState, p: HInfinityParameters) -> float:
    total: float = p.step[i, 10] * v + p.step[i, 11] * x.error + p.step[i, 12] * x.forward
    for j in range(10):
        total += p.step[i, j] * x.inner[j]
    return total


@scalar
def inner_step(v: float, x: HInfinityState, p: HInfinityParameters) -> Inner:
    """The linear part one period on from ``x``, in which it gave ``v`` in N m."""
    return Inner(
        _row(0, v, x, p),
        _row(1, v, x, p),
        _row(2, v, x, p),
        _row(3, v, x, p),
        _row(4, v, x, p),
        _row(5, v, x, p),
        _row(6, v, x, p),
        _row(7, v, x, p),
        _row(8, v, x, p),
        _row(9, v, x, p),
    )


@scalar
def inner_output(inner: Inner, error: float, forward: float, p: HInfinityParameters) -> float:
    """Torque v in N m of the linear part."""
    total: float = p.output[11] * error + p.output[12] * forward
    for j in range(10):
        total += p.output[j] * inner[j]
    return total


@scalar
def followed(o: Observation, felt: Felt, p: HInfinityParameters) -> float:
    """Share of the reference's acceleration that a motor can follow at the present slope of the assist."""
    return min(felt.J_ref / (p.least_inertia * assist_slope(o.torsion_bar_torque, felt)), 1.0)


@scalar
def between(speed: float, schedule: Any, values: Any) -> float:
    """One of ``values`` [n] per row of the schedule, at a speed in m/s; held beyond the ends."""
    last = schedule.shape[0] - 1
    value: float = values[0]
    for k in range(last):
        span = schedule[k + 1, 0] - schedule[k, 0]
        share = min(max((speed - schedule[k, 0]) / span, 0.0), 1.0)
        value += share * (values[k + 1] - values[k])
    return value


@scalar
def needed(acceleration: float, rate: float, load: float, friction: float, o: Observation, p: Any) -> float:
    """Motor torque at the lower body in N m for a motion of it."""
    own: float = p.J_pin * acceleration + p.b_pin * rate + friction
    return own + p.rack_share * load - o.torsion_bar_torque


@scalar
def torque_law(o: Observation, x: HInfinityState, p: HInfinityParameters) -> tuple[float, HInfinityState]:
    """Impedance: the acceleration that the measured torque gives the reference at the measured motion."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, o.pinion_angle - x.felt_angle, felt.M_fric_C, felt.c_fric)
    # Springs answered late take damping away: load and friction are taken at the law's own motion,
    # by what this is ahead of the measured one.
    then_friction = dahl_step(x.then_friction, x.angle - x.then_angle, felt.M_fric_C, felt.c_fric)
    more = between(o.speed, p.schedule, p.instant) * (x.angle - o.pinion_angle)
    gap = more + felt.b_ref * (x.rate - o.pinion_rate) + then_friction - felt_friction
    surplus = assisted(o.torsion_bar_torque, felt) - o.effective_torque - gap
    acceleration = followed(o, felt, p) * (o.pinion_acceleration + surplus / felt.J_ref)
    rate = x.rate + p.period * (acceleration - p.leak * (x.rate - o.pinion_rate))
    angle = x.angle + p.period * (0.5 * (x.rate + rate) - p.leak * (x.angle - o.pinion_angle))
    load = load_of(o, o.pinion_acceleration, o.pinion_rate, felt_friction, felt) + more
    error = angle - o.pinion_angle
    forward = needed(acceleration, rate, load, friction, o, p)
    inner = inner_step(p.motor_ratio * o.last_torque_1 - x.forward, x, p)
    command = (forward + inner_output(inner, error, forward, p)) / p.motor_ratio
    return command, HInfinityState(
        inner, error, forward, angle, rate, 0.0, friction, o.pinion_angle, felt_friction, o.pinion_angle, then_friction, x.angle
    )


@scalar
def angle_law(o: Observation, x: HInfinityState, p: HInfinityParameters) -> tuple[float, HInfinityState]:
    """Admittance: the reference's own motion, its acceleration as far as it can be followed."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, o.reference - x.felt_angle, felt.M_fric_C, felt.c_fric)
    # ``angle`` and ``rate``: what the reference is ahead of what is followed, by the part left out.
    share = followed(o, felt, p)
    pull = p.return_rate * share
    back = pull * pull * x.angle + 2.0 * pull * x.rate
    ahead = (1.0 - share) * o.reference_acceleration - back
    # Trapezoids, as good as the reference's own integration: what is left of the two is small.
    rate = x.rate + 0.5 * p.period * (x.ahead + ahead)
    angle = x.angle + 0.5 * p.period * (x.rate + rate)
    acceleration = o.reference_acceleration - ahead
    load = load_of(o, o.reference_acceleration, o.reference_rate, felt_friction, felt)
    load = load - between(o.speed, p.schedule, p.instant) * angle
    error = o.reference - angle - o.pinion_angle
    forward = needed(acceleration, o.reference_rate - rate, load, friction, o, p)
    inner = inner_step(p.motor_ratio * o.last_torque_1 - x.forward, x, p)
    command = (forward + inner_output(inner, error, forward, p)) / p.motor_ratio
    return command, HInfinityState(
        inner, error, forward, angle, rate, ahead, friction, o.pinion_angle, felt_friction, o.reference, 0.0, 0.0
    )


def instant_stiffness(reference: Reference) -> Any:
    """What a sudden turn changes of the reference's load, N m/rad, for each row of its table [n]."""
    rows = ((float(row[0]), ReferenceParameters(*row[1:].tolist())) for row in reference.table)
    return np.array([load_matrices(speed, p)[3][0, 0] for speed, p in rows])


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of HInfinityParameters."""
    impedance = causality == "impedance"

    def for_period(period: float) -> HInfinityParameters:
        delay = total_delay(plant, period)
        weights = {name: gains[name] for name in Weights._fields if name in gains}
        chosen = with_gains(weights_for(plant, impedance, delay), weights, "h_infinity")
        hardware = hardware_of(plant, reference, period)
        leak = LEAK
        sampled = designed(plant, felt_of(hardware["schedule"]), chosen, impedance, leak, period)
        names = set(HInfinityParameters._fields)
        parameters = HInfinityParameters(
            **{name: value for name, value in hardware.items() if name in names},
            instant=instant_stiffness(reference),
            step=sampled.step,
            output=sampled.output,
            achieved=sampled.achieved,
            leak=leak,
            least_inertia=0.5 * chosen.felt_inertia,
            return_rate=0.05 / delay,
            **chosen._asdict(),
        )
        return with_gains(parameters, {k: v for k, v in gains.items() if k not in weights}, "h_infinity")

    return LawController(torque_law if impedance else angle_law, for_period, HInfinityState())


LEAK = 2.0


def weights_for(plant: Plant, impedance: bool, delay: float) -> Weights:
    """The weights of the design."""
    if plant.rack_share > 0.5:
        return Weights(0.0077, 60.0, 20.0, 40.0, 3.0, 0.2, 600.0, 0.4, 4.0, 1.3e-6, 0.02)
    return Weights(0.0102, 30.0, 40.0, 40.0, 3.0, 0.1, 400.0, 0.22, 0.4, 3e-7, 0.02)
