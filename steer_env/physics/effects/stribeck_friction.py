"""Friction that is higher near standstill than when sliding."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.physics.friction import stribeck_level
from steer_env.units import Quantity


class StribeckFriction(NamedTuple):
    """Absent at zero."""

    extra_Nm: Annotated[float, Quantity("N m", "level at rest beyond the sliding level", 0.0, 20.0, "absent")] = 0.0
    speed_radps: Annotated[float, Quantity("rad/s", "Stribeck rate v_s", 1e-3, 10.0, "assumption")] = 0.1


@scalar
def extra_level(rate: float, p: StribeckFriction) -> float:
    """Level in N m beyond the sliding one at a rate in rad/s: S exp(-(rate / v_s)^2)."""
    if p.extra_Nm == 0.0:
        return 0.0
    return stribeck_level(rate, 0.0, p.extra_Nm, p.speed_radps)


@scalar
def at_pinion(x: Moment, p: StribeckFriction) -> float:
    """Extra friction level in N m at the pinion."""
    return extra_level(x.pinion_rate, p)


VEHICLE = Effect(
    name="stribeck_friction",
    kind="vehicle",
    enters="friction level + S exp(-(rate / v_s)^2)",
    parameters=StribeckFriction,
    amplitude="extra_Nm",
    plausible={"extra_Nm": Plausible(0.3, 4.0), "speed_radps": Plausible(0.02, 0.6)},
    probes=tuple({"extra_Nm": 1.0, "speed_radps": rate} for rate in (0.04, 0.15, 0.5)),
    ports={"pinion_friction_level": at_pinion},
    shows_in="reversals, slow motion",
)
