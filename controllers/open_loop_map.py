"""What is in production today: torque maps that do not close a loop on the reference.

EPAS: a boost curve (K_assist of the measured torsion-bar torque) with its phase lead, base damping,
and partial compensation of the hardware's own inertia and friction by nominal values. What the
hardware keeps, the driver feels. Steer-by-wire: a torque map sent to the motor as it is; the
hardware's inertia and friction come on top. In impedance it is the reference torque without J_ref
a, for which the hardware's inertia has to stand in: sent with it, the loop around a light rotor is
unstable at once (J_ref / J_pin = 10 in the published rows). In admittance, where no reference
torque exists, the usual map of angle, rate and speed: the identified steady stiffness, damping and
friction, without inertia or frequency response.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.blocks import (
    Notch,
    NotchState,
    assist_slope,
    assisted,
    low_pass,
    notch_step,
    torque_of,
)
from controllers.hardware import bar_notch, total_delay
from controllers.law import Gain, LawController, with_gains
from controllers.schedule import Felt, Schedule, felt_at, schedule_of
from steer_env.interface import Observation
from steer_env.physics._jit import scalar
from steer_env.physics.friction import dahl_step
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# What tuning may change, as factors on the design's own values.
TUNABLE: dict[str, tuple[float, float]] = {
    "lead": (0.3, 3.0),
    "lead_bandwidth": (0.4, 2.5),
    "boost_limit": (0.6, 3.0),
    "gain_limit": (0.4, 3.0),
    "slow_bandwidth": (0.2, 5.0),
    "damping": (0.1, 4.0),
    "inertia_share": (0.3, 3.0),
    "friction_share": (0.3, 2.0),
}


class MapParameters(NamedTuple):
    """Parameters of the three maps; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    lead: Annotated[float, Quantity("s", "phase lead of the boost", 0.0, 0.1, "assumption: two loop delays")]
    lead_bandwidth: Annotated[float, Quantity("rad/s", "filter of the lead", 1.0, 1e4, "assumption: 1.5 / delay")]
    boost_limit: Annotated[float, Quantity("-", "largest boost M_eff / M_tb", 1.0, 50.0, "assumption")] = 6.5
    gain_limit: Annotated[float, Quantity("-", "largest boost slope for fast torque", 1.0, 50.0, "assumption")] = 5.0
    slow_bandwidth: Annotated[float, Quantity("rad/s", "what counts as slow", 0.1, 1e3, "assumption: 3 Hz")] = 20.0
    damping: Annotated[float, Quantity("N m s/rad", "base damping", 0.0, 20.0, "assumption")] = 0.5
    inertia_share: Annotated[float, Quantity("-", "share of J_pin that is compensated", 0.0, 1.0, "assumption")] = 0.3
    friction_share: Annotated[float, Quantity("-", "share of M_fric that is compensated", 0.0, 1.0, "assumption")] = 0.5
    notch: Notch = Notch()


class MapState(NamedTuple):
    """Filtered torques and friction torques in N m, the angle these follow in rad, the notch."""

    torque: float = 0.0
    slow_torque: float = 0.0
    friction: float = 0.0
    felt_friction: float = 0.0
    angle: float = 0.0
    notch: NotchState = NotchState()


@scalar
def base_damping(felt: Felt, p: MapParameters) -> float:
    """Damping in N m s/rad that an SbW map adds: its own, and what a negative b_ref takes away."""
    return p.damping + max(-felt.b_ref, 0.0)


@scalar
def limited_boost(felt: Felt, p: MapParameters) -> Felt:
    """The reference with its assist held to ``boost_limit``, as production boost curves are."""
    r = max(felt.r, 1.0 / p.boost_limit)
    return Felt(
        felt.J_ref,
        felt.b_ref,
        felt.k_gain,
        felt.M_fric_C,
        felt.c_fric,
        r,
        felt.sigma,
        felt.stiffness,
        felt.linear,
    )


@scalar
def boost_law(o: Observation, x: MapState, p: MapParameters) -> tuple[float, MapState]:
    """EPAS, both causalities: neither the reference torque nor the reference angle is looked at."""
    felt = limited_boost(felt_at(o.speed, p.schedule), p)
    friction = dahl_step(x.friction, o.pinion_angle - x.angle, p.M_fric, p.c_fric)
    torque = low_pass(x.torque, o.torsion_bar_torque, p.lead_bandwidth, p.period)
    torque_rate = p.lead_bandwidth * (o.torsion_bar_torque - torque)
    # Where the curve is steep only slow torque gets its full slope: fast torque would close too
    # strong a loop.
    slow = low_pass(x.slow_torque, o.torsion_bar_torque, p.slow_bandwidth, p.period)
    fast_gain = min(assist_slope(slow, felt), p.gain_limit)
    boost = assisted(slow, felt) + fast_gain * (o.torsion_bar_torque - slow) - o.torsion_bar_torque
    boost = boost + fast_gain * p.lead * torque_rate
    compensation = p.inertia_share * p.J_pin * o.pinion_acceleration + p.friction_share * friction
    lower = boost + compensation - p.damping * o.pinion_rate
    return lower / p.motor_ratio, MapState(torque, slow, friction, 0.0, o.pinion_angle, x.notch)


@scalar
def reference_torque_law(o: Observation, x: MapState, p: MapParameters) -> tuple[float, MapState]:
    """Steer-by-wire, impedance: the reference torque without its inertia term."""
    felt = felt_at(o.speed, p.schedule)
    M_eff = o.effective_torque - felt.J_ref * o.pinion_acceleration + base_damping(felt, p) * o.pinion_rate
    torque, notch = notch_step(torque_of(M_eff, felt), x.notch, p.notch)
    return -torque / p.motor_ratio, MapState(0.0, 0.0, 0.0, 0.0, o.pinion_angle, notch)


@scalar
def angle_map_law(o: Observation, x: MapState, p: MapParameters) -> tuple[float, MapState]:
    """Steer-by-wire, admittance: torque from angle, rate and speed."""
    felt = felt_at(o.speed, p.schedule)
    friction = dahl_step(x.felt_friction, o.pinion_angle - x.angle, felt.M_fric_C, felt.c_fric)
    M_eff = felt.stiffness * o.pinion_angle + (felt.b_ref + base_damping(felt, p)) * o.pinion_rate + friction
    torque, notch = notch_step(torque_of(M_eff, felt), x.notch, p.notch)
    return -torque / p.motor_ratio, MapState(0.0, 0.0, 0.0, friction, o.pinion_angle, notch)


def make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> LawController:
    """The map for a plant; ``gains`` replace fields of MapParameters."""
    s = plant.steering

    def for_period(period: float) -> MapParameters:
        delay = total_delay(plant, period)
        parameters = MapParameters(
            schedule=schedule_of(reference),
            period=period,
            motor_ratio=s.motor_ratio,
            J_pin=s.J_pin,
            M_fric=s.M_fric,
            c_fric=s.c_fric,
            lead=2.0 * delay,
            lead_bandwidth=1.5 / delay,
            notch=bar_notch(plant, period),
        )
        return with_gains(parameters, gains, "open_loop_map")

    steer_by_wire = {"impedance": reference_torque_law, "admittance": angle_map_law}
    law = boost_law if plant.rack_share > 0.5 else steer_by_wire[causality]
    return LawController(law, for_period, MapState())
