"""A stiffness at the pinion at every speed: steering lifts the car (kingpin geometry)."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class JackingTorque(NamedTuple):
    """Absent at zero."""

    stiffness_Nm_per_rad: Annotated[float, Quantity("N m/rad", "stiffness at the pinion", -50.0, 50.0, "absent")] = 0.0


@scalar
def torque(x: Moment, p: JackingTorque) -> float:
    """Torque in N m that the rack hands to the pinion besides the tyres': k delta."""
    return p.stiffness_Nm_per_rad * x.pinion_angle


VEHICLE = Effect(
    name="jacking_torque",
    kind="vehicle",
    enters="M_rack + k delta",
    parameters=JackingTorque,
    amplitude="stiffness_Nm_per_rad",
    # Ordinary kingpin geometry gives 0.1 to 0.5 N m/rad; more than 1.5 is not jacking.
    plausible={"stiffness_Nm_per_rad": Plausible(0.05, 1.5)},
    probes=({"stiffness_Nm_per_rad": 0.5},),
    ports={"rack_torque": torque},
    shows_in="on-centre stiffness at low speed, trail that drifts with speed",
)
