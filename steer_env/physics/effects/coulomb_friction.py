"""Dry friction that is fully there once anything moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.units import Quantity

TRAVEL = 1e-3  # rad of wind-up: below what an encoder on a wheel resolves well (our assumption)


class CoulombFriction(NamedTuple):
    """Absent at zero."""

    level_Nm: Annotated[float, Quantity("N m", "Coulomb level", 0.0, 20.0, "absent")] = 0.0


@scalar
def level(x: Any, p: CoulombFriction) -> float:
    """Friction level in N m."""
    return p.level_Nm


@scalar
def travel(x: Any, p: CoulombFriction) -> float:
    """Wind-up in rad."""
    return 0.0 if p.level_Nm == 0.0 else TRAVEL


RIG = Effect(
    name="coulomb_friction",
    kind="rig",
    enters="+ M_C sign(q')",
    parameters=CoulombFriction,
    amplitude="level_Nm",
    plausible={"level_Nm": Plausible(0.02, 2.0)},
    probes=({"level_Nm": 0.1},),
    ports={"friction_level": level, "friction_travel": travel},
    shows_in="torque that changes its sign with the rate's",
)
DRIVE = replace(RIG, kind="drive", plausible={"level_Nm": Plausible(0.05, 2.0)}, probes=({"level_Nm": 0.3},))
