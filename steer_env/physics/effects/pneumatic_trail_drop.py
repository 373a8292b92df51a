"""The pneumatic trail shrinks with slip, so the torque falls off in hard cornering."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class PneumaticTrailDrop(NamedTuple):
    """Absent at a share of zero."""

    pneumatic_share: Annotated[float, Quantity("-", "pneumatic share of n_t", 0.0, 1.0, "absent")] = 0.0
    slip_rad: Annotated[float, Quantity("rad", "slip at which that share is gone", 0.01, 2.0, "assumption")] = 0.1


@scalar
def factor(x: Moment, p: PneumaticTrailDrop) -> float:
    """What n_t loses, as a factor: mech + pneu (1 - |a_f| / a_s)+ with mech = 1 - pneu, minus one."""
    if p.pneumatic_share == 0.0:
        return 0.0
    return -p.pneumatic_share * min(abs(x.front_slip) / p.slip_rad, 1.0)


VEHICLE = Effect(
    name="pneumatic_trail_drop",
    kind="vehicle",
    enters="n_t (mech + pneu (1 - |a_f| / a_s)+)",
    parameters=PneumaticTrailDrop,
    amplitude="pneumatic_share",
    plausible={"slip_rad": Plausible(0.05, 0.2), "pneumatic_share": Plausible(0.3, 0.8)},
    probes=({"pneumatic_share": 0.5, "slip_rad": 0.1},),
    ports={"trail": factor},
    shows_in="torque that falls off at large lateral acceleration",
)
