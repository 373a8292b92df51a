"""Play between pinion and rack: the load lays the rack on one flank of the gap."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity

LAID_ON = 0.2  # N m of rack torque that lays the rack firmly on a flank (our assumption; friction of the rack)


class Backlash(NamedTuple):
    """Absent at zero."""

    half_gap_rad: Annotated[float, Quantity("rad", "half of the play, as pinion angle", 0.0, 0.2, "absent")] = 0.0


@scalar
def lost_angle(x: Moment, p: Backlash) -> float:
    """Pinion angle in rad that the rack lags behind: the gap, taken up on the side that the load pushes to.

    A light rack without friction of its own rests on the flank that carries the tyres' torque; in slow motion the
    rack angle is then the dead zone of the pinion angle.
    """
    if p.half_gap_rad == 0.0:
        return 0.0
    return -p.half_gap_rad * min(max(x.rack_torque * (1.0 / LAID_ON), -1.0), 1.0)


VEHICLE = Effect(
    name="backlash",
    kind="vehicle",
    enters="dead zone between pinion and rack",
    parameters=Backlash,
    amplitude="half_gap_rad",
    plausible={"half_gap_rad": Plausible(0.001, 0.02)},
    probes=({"half_gap_rad": 0.004}, {"half_gap_rad": 0.015}),
    ports={"rack_angle": lost_angle},
    shows_in="near centre, response at small amplitude",
)
