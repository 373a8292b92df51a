"""Friction of the column's bearings, on the wheel side of the torsion bar."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity

STIFFNESS = 100.0  # N m/rad, Dahl stiffness of the column's friction (our assumption: breakaway within a degree)


class ColumnFriction(NamedTuple):
    """Absent at zero."""

    torque_Nm: Annotated[float, Quantity("N m", "Coulomb level", 0.0, 10.0, "absent")] = 0.0


@scalar
def level(x: Moment, p: ColumnFriction) -> float:
    """Friction level in N m on the wheel side."""
    return p.torque_Nm


VEHICLE = Effect(
    name="column_friction",
    kind="vehicle",
    enters="Dahl friction between wheel and torsion bar",
    parameters=ColumnFriction,
    amplitude="torque_Nm",
    plausible={"torque_Nm": Plausible(0.05, 0.8)},
    probes=({"torque_Nm": 0.3},),
    ports={"column_friction_level": level},
    needs=("steering_torque_Nm",),
    shows_in="steering torque against torsion-bar torque only",
)
