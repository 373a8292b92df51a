"""Play between motor and wheel: the wheel coasts across it while the motor turns alone."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class RigBacklash(NamedTuple):
    """Absent at a gap of zero."""

    half_gap_rad: Annotated[float, Quantity("rad", "half of the play", 0.0, 0.2, "absent")] = 0.0
    wheel_share: Annotated[
        float, Quantity("-", "of J, behind the play", 0.05, 0.98, "assumption: a wheel on a direct drive")
    ] = 0.7


@scalar
def gap(x: RigMoment, p: RigBacklash) -> float:
    """Half of the play in rad."""
    return p.half_gap_rad


@scalar
def share(x: RigMoment, p: RigBacklash) -> float:
    """Share of inertia that lies behind the play; the bearings and their damping are the motor's."""
    return 0.0 if p.half_gap_rad == 0.0 else p.wheel_share


RIG = Effect(
    name="backlash",
    kind="rig",
    enters="a gap between the motor's share of J and the wheel's",
    parameters=RigBacklash,
    amplitude="half_gap_rad",
    plausible={"half_gap_rad": Plausible(0.001, 0.03), "wheel_share": Plausible(0.2, 0.95)},
    # A flank met at the wrong time fits worse than none: the search must start within a tenth of the true gap.
    probes=tuple({"half_gap_rad": 0.001 * 1.12**k} for k in range(31)),
    ports={"half_gap": gap, "wheel_share": share},
    bends=True,
    shows_in="torque that is missing, then made up for at once, where the acceleration changes its sign",
)
