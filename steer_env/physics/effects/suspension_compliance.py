"""Side force turns the front wheels back through elastic bushes."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class SuspensionCompliance(NamedTuple):
    """Absent at zero."""

    rad_per_N: Annotated[float, Quantity("rad/N", "front steer lost per axle side force", -1e-5, 1e-5, "absent")] = 0.0


@scalar
def angle(x: Moment, p: SuspensionCompliance) -> float:
    """Road-wheel angle in rad that the side force adds: -c F_yf."""
    return -p.rad_per_N * x.front_force


VEHICLE = Effect(
    name="suspension_compliance",
    kind="vehicle",
    enters="delta_tyre - c F_yf",
    parameters=SuspensionCompliance,
    amplitude="rad_per_N",
    plausible={"rad_per_N": Plausible(1e-7, 3e-6)},
    probes=({"rad_per_N": 1e-6},),
    ports={"tyre_angle": angle},
    shows_in="understeer, rack force above 2 Hz",
)
