"""Stribeck friction of a bench motor, whose nominal model has no friction of its own."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.coulomb_friction import TRAVEL
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.friction import stribeck_level
from steer_env.units import Quantity


class RigStribeck(NamedTuple):
    """Absent at an extra level of zero together with the level."""

    extra_Nm: Annotated[float, Quantity("N m", "level at rest beyond the sliding level", 0.0, 20.0, "absent")] = 0.0
    level_Nm: Annotated[float, Quantity("N m", "sliding level", 0.0, 20.0, "absent")] = 0.0
    speed_radps: Annotated[float, Quantity("rad/s", "Stribeck rate v_s", 1e-3, 10.0, "assumption")] = 0.2


@scalar
def level(x: RigMoment, p: RigStribeck) -> float:
    """Friction level in N m at a rate: M_C + S exp(-(rate / v_s)^2)."""
    if p.extra_Nm == 0.0:
        return p.level_Nm
    return stribeck_level(x.rate, p.level_Nm, p.level_Nm + p.extra_Nm, p.speed_radps)


@scalar
def travel(x: RigMoment, p: RigStribeck) -> float:
    """Wind-up in rad."""
    return 0.0 if p.extra_Nm == 0.0 and p.level_Nm == 0.0 else TRAVEL


RIG = Effect(
    name="stribeck_friction",
    kind="rig",
    enters="+ (M_C + S exp(-(q' / v_s)^2)) sign(q')",
    parameters=RigStribeck,
    amplitude="extra_Nm",
    plausible={
        "extra_Nm": Plausible(0.02, 2.0),
        "level_Nm": Plausible(0.02, 2.0),  # what does not slide with friction does not stick either
        "speed_radps": Plausible(0.05, 2.0),
    },
    probes=tuple({"extra_Nm": 0.1, "level_Nm": 0.1, "speed_radps": v} for v in (0.1, 0.4, 1.5)),
    ports={"friction_level": level, "friction_travel": travel},
    shows_in="friction that falls as motion sets in",
)
