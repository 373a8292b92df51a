"""Drag that grows with the square of the rate."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class QuadraticDrag(NamedTuple):
    """Absent at zero."""

    drag_Nms2_per_rad2: Annotated[float, Quantity("N m s2/rad2", "torque per rate squared", -1.0, 1.0, "absent")] = 0.0


@scalar
def torque(x: RigMoment, p: QuadraticDrag) -> float:
    """Torque in N m: c q' |q'|."""
    return p.drag_Nms2_per_rad2 * x.rate * abs(x.rate)


RIG = Effect(
    name="quadratic_drag",
    kind="rig",
    enters="+ c q' |q'|",
    parameters=QuadraticDrag,
    amplitude="drag_Nms2_per_rad2",
    plausible={"drag_Nms2_per_rad2": Plausible(2e-4, 0.05)},
    probes=({"drag_Nms2_per_rad2": 0.005},),
    ports={"torque": torque},
    shows_in="damping that grows with the rate",
)
