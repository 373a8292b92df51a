"""Drivers: an arm or robot as inertia, damper and spring to a moving hand, plus a torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.units import Quantity

_ARM = "assumption: order of magnitude after Pick and Cole, field report 1.5"


class Driver(NamedTuple):
    """Grip on the wheel; defaults are two relaxed hands."""

    J: Annotated[float, Quantity("kg m2", "inertia that moves with the wheel", 0.0, 1.0, _ARM)] = 0.1
    b: Annotated[float, Quantity("N m s/rad", "damping to the hand target", 0.0, 100.0, _ARM)] = 0.6
    k: Annotated[float, Quantity("N m/rad", "stiffness to the hand target", 0.0, 5000.0, _ARM)] = 7.0
    torque_limit: Annotated[float, Quantity("N m", "largest torque", 0.0, 100.0, "assumption")] = 30.0


class Hand(NamedTuple):
    """What the driver wants: hand angle in rad, rate in rad/s, own torque in N m, grip 0 to 1."""

    angle: float
    rate: float
    torque: float
    grip: float


@scalar
def driver_torque(
    angle: float,
    rate: float,
    target_angle: float,
    target_rate: float,
    torque: float,
    grip: float,
    p: Driver,
) -> float:
    """Torque in N m on the wheel: spring and damper to the target, plus ``torque``.

    The driver's own inertia is not in it. ``grip`` from 0 (let go) to 1 scales spring and damper.
    """
    wanted = grip * (p.k * (target_angle - angle) + p.b * (target_rate - rate)) + torque
    return min(max(wanted, -p.torque_limit), p.torque_limit)
