"""A wheel whose mass centre is off its axis."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class GravityUnbalance(NamedTuple):
    """Absent at zero; the phase is free."""

    sin_Nm: Annotated[float, Quantity("N m", "A of A sin q + B cos q", -10.0, 10.0, "absent")] = 0.0
    cos_Nm: Annotated[float, Quantity("N m", "B of A sin q + B cos q", -10.0, 10.0, "absent")] = 0.0


@scalar
def torque(x: RigMoment, p: GravityUnbalance) -> float:
    """Torque in N m that gravity asks for."""
    if p.sin_Nm == 0.0 and p.cos_Nm == 0.0:
        return 0.0
    return p.sin_Nm * math.sin(x.angle) + p.cos_Nm * math.cos(x.angle)


def amplitude(p: GravityUnbalance) -> float:
    """Weight times its arm in N m."""
    return math.hypot(p.sin_Nm, p.cos_Nm)


RIG = Effect(
    name="gravity_unbalance",
    kind="rig",
    enters="+ A sin q + B cos q",
    parameters=GravityUnbalance,
    amplitude="sin_Nm",
    plausible={"sin_Nm": Plausible(0.0, 2.0, signed=True), "cos_Nm": Plausible(0.0, 2.0, signed=True)},
    probes=({"sin_Nm": 0.2}, {"sin_Nm": 0.001, "cos_Nm": 0.2}),
    ports={"torque": torque},
    shows_in="torque periodic in a turn of the wheel",
    size=amplitude,
    least_size=0.02,
)
