"""Dry friction that winds up over some travel before anything slides (Dahl)."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.units import Quantity


class PreslidingFriction(NamedTuple):
    """Absent at a level of zero."""

    level_Nm: Annotated[float, Quantity("N m", "level when sliding", 0.0, 20.0, "absent")] = 0.0
    travel_rad: Annotated[float, Quantity("rad", "level over stiffness", 1e-4, 2.0, "assumption")] = 0.03


@scalar
def level(x: Any, p: PreslidingFriction) -> float:
    """Friction level in N m."""
    return p.level_Nm


@scalar
def travel(x: Any, p: PreslidingFriction) -> float:
    """Wind-up in rad."""
    return 0.0 if p.level_Nm == 0.0 else p.travel_rad


RIG = Effect(
    name="presliding_friction",
    kind="rig",
    enters="+ Dahl friction (Eq. 15)",
    parameters=PreslidingFriction,
    amplitude="level_Nm",
    plausible={"level_Nm": Plausible(0.02, 2.0), "travel_rad": Plausible(0.005, 0.3)},
    probes=({"level_Nm": 0.1, "travel_rad": 0.02}, {"level_Nm": 0.1, "travel_rad": 0.1}),
    ports={"friction_level": level, "friction_travel": travel},
    shows_in="rounded corners of the hysteresis",
)
DRIVE = replace(
    RIG,
    kind="drive",
    plausible={"level_Nm": Plausible(0.05, 2.0), "travel_rad": Plausible(0.005, 0.3)},
    probes=({"level_Nm": 0.3, "travel_rad": 0.02}, {"level_Nm": 0.3, "travel_rad": 0.1}),
)
