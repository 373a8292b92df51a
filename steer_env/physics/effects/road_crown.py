"""The road leans: gravity pulls the body aside, which the accelerometer does not feel."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import GRAVITY, Quantity


class RoadCrown(NamedTuple):
    """Absent at zero."""

    slope_rad: Annotated[float, Quantity("rad", "cross slope, pulling to the left", -0.2, 0.2, "absent")] = 0.0


@scalar
def acceleration(x: Moment, p: RoadCrown) -> float:
    """Lateral acceleration in m/s2 of the body from gravity alone: g phi."""
    return GRAVITY * p.slope_rad


VEHICLE = Effect(
    name="road_crown",
    kind="vehicle",
    enters="lateral gravity g phi on the body, not in the measured a_y",
    parameters=RoadCrown,
    amplitude="slope_rad",
    plausible={"slope_rad": Plausible(0.003, 0.04, signed=True)},
    probes=({"slope_rad": 0.01},),
    ports={"side_acceleration": acceleration},
    shows_in="bias in torque, angle and lateral acceleration together",
)
