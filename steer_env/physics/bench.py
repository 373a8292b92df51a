"""A force-feedback motor on a bench: J q'' + b q' = torque, with what the catalogue adds."""

from __future__ import annotations

from typing import Any

from steer_env.physics._jit import scalar
from steer_env.physics.effects import rig_ports as ports
from steer_env.physics.effects.rig_backlash import WHEEL_SHARE
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.friction import dahl_step


@scalar
def friction_after(friction: float, travel: float, x: RigMoment, row: Any) -> float:
    """Dahl torque in N m of all frictions together after a travel in rad (exact)."""
    level = ports.friction_level(x, row)
    if level <= 0.0:
        return 0.0
    return dahl_step(friction, travel, level, level / ports.friction_travel(x, row))


@scalar
def wheel_after(wheel: float, angle: float, row: Any) -> float:
    """Angle in rad of what lies behind the play once the motor stands at ``angle`` (a play operator)."""
    half = ports.half_gap(RigMoment(angle, 0.0), row)
    return min(max(wheel, angle - half), angle + half)


@scalar
def engaged_share(moved: float, travel: float) -> float:
    """Share of inertia and damping that takes part while the wheel moved so much of the motor's travel in rad."""
    if travel == 0.0:
        return 1.0
    return 1.0 - WHEEL_SHARE + WHEEL_SHARE * min(max(moved / travel, 0.0), 1.0)


@scalar
def resisting_torque(x: RigMoment, friction: float, row: Any) -> float:
    """Torque in N m that resists besides J q'' and b q'."""
    return friction + ports.torque(x, row)
