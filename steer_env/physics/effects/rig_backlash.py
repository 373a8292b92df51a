"""Play between motor and wheel: inside it the motor turns alone."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity

WHEEL_SHARE = 0.7  # of inertia and damping that lies behind the play (our assumption: a wheel on a direct drive)


class RigBacklash(NamedTuple):
    """Absent at zero."""

    half_gap_rad: Annotated[float, Quantity("rad", "half of the play", 0.0, 0.2, "absent")] = 0.0


@scalar
def gap(x: RigMoment, p: RigBacklash) -> float:
    """Half of the play in rad."""
    return p.half_gap_rad


RIG = Effect(
    name="backlash",
    kind="rig",
    enters="inside the play J and b fall to the motor's share",
    parameters=RigBacklash,
    amplitude="half_gap_rad",
    plausible={"half_gap_rad": Plausible(0.001, 0.03)},
    probes=({"half_gap_rad": 0.005}, {"half_gap_rad": 0.02}),
    ports={"half_gap": gap},
    shows_in="torque that is missing after each reversal",
)
