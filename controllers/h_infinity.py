"""H-infinity: a sampled mixed-sensitivity controller on angle error and sensed torque, robust to the driver's arm.

In the spirit of Chugh, Bruzelius and Kulcsar, Robust H-infinity Position Controller for Steering
Systems (arXiv 2412.19161): the sensed torsion-bar torque enters the position loop, the inertia of
the driver's arm is the uncertainty, and the loop gain is high at low and low at high frequency.

The law has two parts. The first knows the reference and the hardware and is not linear: it finds the
acceleration that the reference has under the measured torque and what the lower body needs for that,

    v_ff = J_pin a_ref + b_pin w + M_fric + share M_load - M_tb.

The second is linear, of ten states, the same at every speed and assist: v = K (e, v_ff) from the
angle error and the feed-forward, made by an H-infinity synthesis (h_infinity_plant: the weights;
synthesis: the solver; h_infinity_sampled: from gamma to a sampled law, ``parameters.achieved``).
It goes on from the torque that was really sent, and takes no error in while limits cut that for long,
so that it does not wind up.

Admittance: e is the reference angle less the measured one. Impedance: the reference's load is taken
at the measured motion, the acceleration that the torque then gives it is integrated twice, leaking
towards the measured motion, and e is what lies between: the torque error without an acceleration
in it.

Where the assist is steep, torque moves the reference faster than a motor behind a delay can follow.
The acceleration is therefore held to that of ``least_inertia``; in admittance what is left out comes
back slowly (``return_rate``).

Where it ends: the reference's acceleration is fed forward by the nominal inertia. On a plant whose
lower body is half as heavy again and whose commands come two periods later than told, what is left
of the damping is used up off centre. Steer-by-wire in impedance: the angle is followed within a few
per cent, which at the turning points, on the spring of the reference's friction, is more torque error
than the laws that render torque at the measured motion have.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from controllers.blocks import assist_slope, assisted, torque_of
from controllers.h_infinity_design import HInfinityParameters, design
from controllers.law import Gain, LawController
from controllers.pid import load_of
from controllers.schedule import Felt, felt_at
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.plants import Plant, Reference

CUT = 1e-3  # N m at the motor: a command cut by more than this met a limit, not a rounding
LONG = 0.05  # s, assumption: longer than the slew rate cuts, shorter than a turn of the wheel
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "felt_inertia": (0.5, 2.0),
    "accuracy": (0.3, 3.0),
    "natural": (0.3, 3.0),
    "bandwidth": (0.5, 2.0),
    "integral": (0.3, 3.0),
    "gain_error": (0.3, 2.4),
    "gain_bandwidth": (0.5, 2.0),
    "inertia_error": (0.5, 2.0),
    "load": (0.3, 3.0),
    "torque_noise": (0.3, 5.0),
    "late": (0.2, 4.0),
    "heavy": (0.7, 1.4),
    "least_inertia": (0.5, 2.0),
    "return_rate": (0.3, 3.0),
    "leak": (0.3, 3.0),
    "own": (0.2, 1.3),
    "lead": (0.2, 3.0),
}


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
    """Linear part, its last inputs (rad, N m), the last command and how long it was cut (N m, s), motion, frictions.

    ``angle``, ``rate`` and ``acceleration`` are a motion of the law's own (rad, rad/s, rad/s2); frictions
    are in N m: ``friction`` is the hardware's, ``seen_friction`` the reference's at the measured angle, both
    follow ``friction_angle``; ``felt_friction`` is the reference's at its own angle.
    """

    inner: Inner = Inner()
    error: float = 0.0
    forward: float = 0.0
    commanded: float = 0.0
    cut: float = 0.0
    angle: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0
    friction: float = 0.0
    friction_angle: float = 0.0
    felt_friction: float = 0.0
    felt_angle: float = 0.0
    seen_friction: float = 0.0


@scalar
def _row(i: int, v: float, error: float, x: HInfinityState, p: HInfinityParameters) -> float:
    total: float = p.step[i, 10] * v + p.step[i, 11] * error + p.step[i, 12] * x.forward
    for j in range(10):
        total += p.step[i, j] * x.inner[j]
    return total


@scalar
def cut_for(o: Observation, x: HInfinityState, p: HInfinityParameters) -> float:
    """Seconds for which the motor's limits have been cutting the command."""
    return x.cut + p.period if abs(o.last_torque_1 - x.commanded) > CUT else 0.0


@scalar
def inner_step(o: Observation, cut: float, x: HInfinityState, p: HInfinityParameters) -> Inner:
    """The linear part one period on from ``x``, by the torque that was really sent.

    Once the command has been ``cut`` for LONG no error is taken in: the error's integral would grow.
    A short cut, as by the motor's slew rate, must not interrupt the loop.
    """
    v = p.motor_ratio * o.last_torque_1 - x.forward
    error = 0.0 if cut > LONG else x.error
    return Inner(
        _row(0, v, error, x, p),
        _row(1, v, error, x, p),
        _row(2, v, error, x, p),
        _row(3, v, error, x, p),
        _row(4, v, error, x, p),
        _row(5, v, error, x, p),
        _row(6, v, error, x, p),
        _row(7, v, error, x, p),
        _row(8, v, error, x, p),
        _row(9, v, error, x, p),
    )


@scalar
def inner_output(inner: Inner, error: float, forward: float, p: HInfinityParameters) -> float:
    """Torque v in N m of the linear part."""
    total: float = p.output[11] * error + p.output[12] * forward
    for j in range(10):
        total += p.output[j] * inner[j]
    return total


@scalar
def followed(acceleration: float, o: Observation, felt: Felt, p: HInfinityParameters) -> float:
    """What is followed of an acceleration in rad/s2 that the measured torque gives the reference.

    No more than if the torque that is over worked on ``least_inertia``.
    """
    M_eff = assisted(o.torsion_bar_torque, felt)
    over = o.torsion_bar_torque - torque_of(M_eff - felt.J_ref * acceleration, felt)
    most = abs(over) / p.least_inertia
    return min(max(acceleration, -most), most)


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
    """Impedance: the motion that the measured torque gives the reference, held to the measured one by a leak."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    seen_friction = dahl_step(x.seen_friction, o.pinion_angle - x.friction_angle, felt.M_fric_C, felt.c_fric)
    at = o.pinion_angle + p.own * (x.angle - o.pinion_angle) + p.lead * o.pinion_rate
    felt_friction = dahl_step(x.felt_friction, at - x.felt_angle, felt.M_fric_C, felt.c_fric)
    # Springs that are answered late take damping away: load and friction are those between the
    # measured motion and the law's own, which is ahead, and some way on.
    load = load_of(o, o.pinion_acceleration, o.pinion_rate, seen_friction, felt)
    load = load + between(o.speed, p.schedule, p.instant) * (at - o.pinion_angle)
    surplus = assisted(o.torsion_bar_torque, felt) - load - felt.b_ref * x.rate - felt_friction
    acceleration = followed(surplus / felt.J_ref, o, felt, p)
    acceleration = min(max(acceleration, -p.fastest), p.fastest)
    rate = x.rate + p.period * (acceleration - p.leak * (x.rate - o.pinion_rate))
    angle = x.angle + p.period * (0.5 * (x.rate + rate) - p.leak * (x.angle - o.pinion_angle))
    error = angle - o.pinion_angle
    forward = needed(acceleration, rate, load, friction, o, p)
    cut = cut_for(o, x, p)
    inner = inner_step(o, cut, x, p)
    command = (forward + inner_output(inner, error, forward, p)) / p.motor_ratio
    frictions = friction, o.pinion_angle, felt_friction, at, seen_friction
    return command, HInfinityState(inner, error, forward, command, cut, angle, rate, 0.0, *frictions)


@scalar
def angle_law(o: Observation, x: HInfinityState, p: HInfinityParameters) -> tuple[float, HInfinityState]:
    """Admittance: the reference's own motion, less what of it cannot be followed."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.friction, o.pinion_angle - x.friction_angle, p.M_fric, p.c_fric)
    felt_friction = dahl_step(x.felt_friction, o.reference - x.felt_angle, felt.M_fric_C, felt.c_fric)
    # ``angle``, ``rate`` and ``acceleration`` of the state: how far the reference is ahead of what is
    # followed. It comes back the slower the steeper the assist is, or it would bring the slope back.
    share = min(felt.J_ref / (p.least_inertia * assist_slope(o.torsion_bar_torque, felt)), 1.0)
    back = p.return_rate * share
    left = o.reference_acceleration - followed(o.reference_acceleration, o, felt, p)
    ahead = left - back * back * x.angle - 2.0 * back * x.rate
    # Trapezoids, as good as the reference's own integration: what remains of the two is small.
    rate = x.rate + 0.5 * p.period * (x.acceleration + ahead)
    angle = x.angle + 0.5 * p.period * (x.rate + rate)
    load = load_of(o, o.reference_acceleration, o.reference_rate, felt_friction, felt)
    load = load - between(o.speed, p.schedule, p.instant) * angle
    error = o.reference - angle - o.pinion_angle
    forward = needed(o.reference_acceleration - ahead, o.reference_rate - rate, load, friction, o, p)
    cut = cut_for(o, x, p)
    inner = inner_step(o, cut, x, p)
    command = (forward + inner_output(inner, error, forward, p)) / p.motor_ratio
    frictions = friction, o.pinion_angle, felt_friction, o.reference, 0.0
    return command, HInfinityState(inner, error, forward, command, cut, angle, rate, ahead, *frictions)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The controller for a plant; ``gains`` replace fields of HInfinityParameters."""
    impedance = causality == "impedance"

    def for_period(period: float) -> HInfinityParameters:
        return design(plant, reference, impedance, period, gains)

    return LawController(torque_law if impedance else angle_law, for_period, HInfinityState())
