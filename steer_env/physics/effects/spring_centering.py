"""A spring that pulls the wheel to its middle."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class SpringCentering(NamedTuple):
    """Absent at zero."""

    stiffness_Nm_per_rad: Annotated[float, Quantity("N m/rad", "stiffness about zero", -100.0, 100.0, "absent")] = 0.0


@scalar
def torque(x: RigMoment, p: SpringCentering) -> float:
    """Torque in N m: k q."""
    return p.stiffness_Nm_per_rad * x.angle


RIG = Effect(
    name="spring_centering",
    kind="rig",
    enters="+ k q",
    parameters=SpringCentering,
    amplitude="stiffness_Nm_per_rad",
    plausible={"stiffness_Nm_per_rad": Plausible(0.05, 20.0)},
    probes=({"stiffness_Nm_per_rad": 0.5},),
    ports={"torque": torque},
    shows_in="torque that follows the angle",
)
