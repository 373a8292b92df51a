"""Friction that differs between turning left and right."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class AsymmetricFriction(NamedTuple):
    """Absent at zero."""

    viscous_Nms_per_rad: Annotated[
        float, Quantity("N m s/rad", "half the difference in damping, left minus right", -5.0, 5.0, "absent")
    ] = 0.0


@scalar
def torque(x: RigMoment, p: AsymmetricFriction) -> float:
    """Torque in N m beyond that of the mean damping: d |q'|."""
    return p.viscous_Nms_per_rad * abs(x.rate)


RIG = Effect(
    name="asymmetric_friction",
    kind="rig",
    enters="+ d |q'|",
    parameters=AsymmetricFriction,
    amplitude="viscous_Nms_per_rad",
    plausible={"viscous_Nms_per_rad": Plausible(0.002, 0.5, signed=True)},
    probes=({"viscous_Nms_per_rad": 0.02},),
    ports={"torque": torque},
    shows_in="torque that follows the size of the rate",
)
