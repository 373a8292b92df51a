"""Passivity observer and controller around another law: ``controllers.make("passivity:pid", ...)``.

Hannaford and Ryu (IEEE Transactions on Robotics and Automation 18(1), 2002) count the energy that a haptic display
gives to the hand and dissipate it as soon as it is more than it ever took. Here the reference itself
gives energy at five of seven speeds, and a loop that tracks it must. So only what the loop gives
*beyond the reference at the same motion* counts, at the driving port, the torsion bar:

    E <- keep E + (M_ref - M_tb) dangle - allowed_damping rate dangle,   M's as means over the period,
    excess = max(E - allowance, 0),    keep = exp(-period / memory)

M_ref is the reference torque at the measured motion: in impedance the observation's own; in admittance
Eq. 4 about the reference's motion, M_eff - J_ref (a_ref - a) - b_ref (w_ref - w) - c (angle_ref - angle)
less the difference of frictions, c the steady stiffness. Torque times displacement is a period's energy
exactly and needs no rate (Stramigioli et al. 2005). ``allowed_damping`` is what one light hand takes by
itself; rendering late lacks less. E leaks to both sides, or a long quiet drive would pay for a long
activity afterwards (the usual reset); ``reset`` empties it.

A torque answers T_d late, so the excess is taken back within T_d instead of one period,

    damper:  i M_mot += -a (w + T_d w'),  a = min(excess / ((w + T_d w')^2 T_d), damping_limit)
    yield:   w_ref += b M_fast, angle and acceleration with it,  b = min(excess / (M_fast^2 T_d), mobility_limit)

w + T_d w' being the rate when the torque arrives. The damper is for the port whose motion the motor moves:
impedance, and admittance behind a soft torsion bar. The yield, velocity in proportion to torque, is its
dual, for admittance behind a stiff sensor: there the inner law follows the reference at once and would
fight a damper; behind a soft bar a yield comes too late. Only fast torque moves the reference, and what
has moved leaks back, so that a steady hand does not make it drift.

Limits: a damper of J_pin / T_d would be an oscillator of its own, and what swings faster than about
1 / (3 T_d) in Hz meets either one in the wrong phase. While there is no excess the command is the inner
law's, bit by bit. ``gains`` are the wrapper's; the inner law takes its shipped ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Annotated, Any, NamedTuple

import controllers
from controllers.blocks import Notch, NotchState, low_pass, notch_step, torque_of
from controllers.hardware import bar_notch, total_delay
from controllers.law import PERIOD, Gain, LawController, with_gains
from controllers.schedule import Schedule, felt_at, schedule_of
from steer_env.interface import Controller, Law, Observation
from steer_env.physics._jit import named, scalar
from steer_env.physics.friction import dahl_step
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "memory": (0.3, 4.0),
    "allowance": (0.1, 10.0),
    "allowed_damping": (0.2, 3.0),
    "damping_limit": (0.2, 3.0),
    "mobility_limit": (0.2, 3.0),
}


class PassivityParameters(NamedTuple):
    """The inner law's parameters and the wrapper's own; torques at the lower body."""

    inner: Any  # parameters of the inner law
    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    delay: Annotated[float, Quantity("s", "T_d", 1e-5, 0.2, "computed from the plant")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, "the plant's nominal value")]
    admittance: Annotated[float, Quantity("-", "1 admittance, 0 impedance", 0, 1, "the loop's own")]
    damping_limit: Annotated[float, Quantity("N m s/rad", "most damping", 0.0, 1e3, "assumption: 0.2 J_pin / T_d")]
    mobility_limit: Annotated[float, Quantity("rad/(N m s)", "most yield", 0.0, 1e3, "assumption: 0.3 T_d / J_pin")]
    memory: Annotated[float, Quantity("s", "how long energy counts", 0.01, 1e3, "assumption")] = 0.5
    allowance: Annotated[float, Quantity("J", "energy that is let go", 0.0, 10.0, "assumption")] = 0.01
    allowed_damping: Annotated[
        float, Quantity("N m s/rad", "damping that may lack", 0.0, 10.0, "assumption: one light hand's")
    ] = 0.3
    fast_bandwidth: Annotated[
        float, Quantity("rad/s", "torque faster than this moves the reference", 0.1, 1e3, "assumption: 3 Hz")
    ] = 20.0
    offset_memory: Annotated[float, Quantity("s", "how long a yielded angle stays", 1e-3, 10.0, "assumption")] = 0.1
    notch: Notch = Notch()


class EnergyState(NamedTuple):
    """Energy in J beyond the reference, missing torque and two frictions in N m, two angles in rad."""

    energy: float = 0.0
    missing: float = 0.0
    angle: float = 0.0
    reference: float = 0.0
    felt_friction: float = 0.0
    own_friction: float = 0.0


class PassivityState(NamedTuple):
    """The inner law's state, what is counted, slow torque in N m, yielded angle (rad) and rate (rad/s)."""

    inner: Any
    observed: EnergyState = EnergyState()
    slow_torque: float = 0.0
    offset: float = 0.0
    rate: float = 0.0
    notch: NotchState = NotchState()


@scalar
def observe(o: Observation, x: EnergyState, p: PassivityParameters) -> EnergyState:
    """The passivity observer, one period on."""
    moved = o.pinion_angle - x.angle
    felt_friction, own_friction = x.felt_friction, x.own_friction
    wanted = o.reference
    if p.admittance > 0.5:
        felt = felt_at(o.speed, p.schedule)
        felt_friction = dahl_step(x.felt_friction, o.reference - x.reference, felt.M_fric_C, felt.c_fric)
        own_friction = dahl_step(x.own_friction, moved, felt.M_fric_C, felt.c_fric)
        inertial = felt.J_ref * (o.reference_acceleration - o.pinion_acceleration)
        viscous = felt.b_ref * (o.reference_rate - o.pinion_rate)
        elastic = felt.stiffness * (o.reference - o.pinion_angle) + felt_friction - own_friction
        wanted = torque_of(o.effective_torque - inertial - viscous - elastic, felt)
    missing = wanted - o.torsion_bar_torque
    given = 0.5 * (missing + x.missing) * moved - p.allowed_damping * o.pinion_rate * moved
    energy = math.exp(-p.period / p.memory) * x.energy + given
    return EnergyState(energy, missing, o.pinion_angle, o.reference, felt_friction, own_friction)


@scalar
def coefficient(observed: EnergyState, size: float, limit: float, p: PassivityParameters) -> float:
    """What takes the excess back within T_d when it acts on ``size``, at most ``limit``; 0 without excess."""
    excess = max(observed.energy - p.allowance, 0.0)
    if excess == 0.0:
        return 0.0
    per_unit = size * size * p.delay
    return limit if excess >= limit * per_unit else excess / per_unit


@cache
def damped(inner: Law) -> Law:
    """A law whose motor torque resists the rate while there is excess."""

    def law(o: Observation, x: PassivityState, p: PassivityParameters) -> tuple[float, PassivityState]:
        command, state = inner(o, x.inner, p.inner)
        observed = observe(o, x.observed, p)
        ahead = o.pinion_rate + p.delay * o.pinion_acceleration
        damping = coefficient(observed, ahead, p.damping_limit, p)
        resisting, notch = notch_step(-damping * ahead, x.notch, p.notch)
        return command + resisting / p.motor_ratio, PassivityState(state, observed, 0.0, 0.0, 0.0, notch)

    return scalar(named(law, inner.__module__, inner))


@cache
def yielding(inner: Law) -> Law:
    """A law that is shown a reference which gives way to fast torque while there is excess."""

    def law(o: Observation, x: PassivityState, p: PassivityParameters) -> tuple[float, PassivityState]:
        observed = observe(o, x.observed, p)
        slow = low_pass(x.slow_torque, o.torsion_bar_torque, p.fast_bandwidth, p.period)
        fast = o.torsion_bar_torque - slow
        rate = coefficient(observed, fast, p.mobility_limit, p) * fast
        offset = math.exp(-p.period / p.offset_memory) * x.offset + p.period * rate
        shown = Observation(
            o.pinion_angle,
            o.pinion_rate,
            o.pinion_acceleration,
            o.torsion_bar_torque,
            o.reference + offset,
            o.reference_rate + rate,
            o.reference_acceleration + (rate - x.rate) / p.period,
            o.effective_torque,
            o.speed,
            o.last_torque_1,
            o.last_torque_2,
            o.last_torque_3,
            o.last_torque_4,
        )
        command, state = inner(shown, x.inner, p.inner)
        return command, PassivityState(state, observed, slow, offset, rate, x.notch)

    return scalar(named(law, inner.__module__, inner))


class PassivityController(LawController):
    """A LawController whose law repeats itself only as often as the one inside."""

    def __init__(self, law: Law, design: Callable[[float], Any], around: Controller) -> None:
        self.around = around
        super().__init__(law, design, PassivityState(around.state()))

    @property
    def decimation(self) -> int:
        """Control periods from one step of the law inside to the next."""
        return int(getattr(self.around, "decimation", 1))


def make(plant: Plant, reference: Reference, causality: str, inner: str = "pid", **gains: Gain) -> LawController:
    """The law ``inner`` (any name that controllers.make takes) with a passivity observer and controller."""
    around = controllers.make(inner, plant, reference, causality)

    def for_period(period: float) -> PassivityParameters:
        around.reset(period)
        delay, J_pin = total_delay(plant, period), plant.steering.J_pin
        parameters = PassivityParameters(
            inner=around.parameters,
            schedule=schedule_of(reference),
            period=period,
            delay=delay,
            motor_ratio=plant.steering.motor_ratio,
            admittance=1.0 if causality == "admittance" else 0.0,
            damping_limit=0.2 * J_pin / delay,
            mobility_limit=0.3 * delay / J_pin,
            notch=bar_notch(plant, period),
        )
        return with_gains(parameters, gains, "passivity")

    stiff = bar_notch(plant, PERIOD) != Notch()
    wrap = yielding if causality == "admittance" and stiff else damped
    return PassivityController(wrap(around.law), for_period, around)
