"""A rack whose ratio gets more direct (or less) towards the lock."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity

# What a rack that gets less direct keeps at least of its ratio on centre, minus one (our assumption): i_s / (1 + a d^2)
# alone would let it stand still and turn back at |d| = 1 / sqrt(-a), 2 rad of pinion angle or less in parking.
LEAST = -0.5


class VariableRatio(NamedTuple):
    """Absent at zero."""

    per_rad2: Annotated[float, Quantity("1/rad2", "a of i_s / (1 + a delta^2)", -2.0, 2.0, "absent")] = 0.0


@scalar
def angle(x: Moment, p: VariableRatio) -> float:
    """Pinion angle in rad that the rack moves beyond the constant ratio: the integral of a delta^2."""
    d = x.pinion_angle
    if p.per_rad2 * d * d >= LEAST:
        return p.per_rad2 * d * d * d * (1.0 / 3.0)
    knee = math.sqrt(LEAST / p.per_rad2)
    return LEAST * math.copysign(abs(d) - knee * (2.0 / 3.0), d)


@scalar
def factor(x: Moment, p: VariableRatio) -> float:
    """What the local ratio adds to the tyres' torque at the pinion, as a factor: a delta^2 (virtual work)."""
    return max(p.per_rad2 * x.pinion_angle * x.pinion_angle, LEAST)


VEHICLE = Effect(
    name="variable_ratio",
    kind="vehicle",
    enters="local ratio i_s / (1 + a delta^2)",
    parameters=VariableRatio,
    amplitude="per_rad2",
    plausible={"per_rad2": Plausible(0.02, 0.4, signed=True)},
    probes=({"per_rad2": 0.05}, {"per_rad2": -0.05}),
    ports={"rack_angle": angle, "rack_ratio": factor},
    shows_in="large angles only",
)
