"""A force-feedback motor on a bench: J q'' + b q' = torque, with what the catalogue adds."""

from __future__ import annotations

from typing import Any

from steer_env.physics._jit import scalar
from steer_env.physics.effects import rig_ports as ports
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.friction import dahl_over


@scalar
def friction_after(friction: float, travel: float, x: RigMoment, row: Any) -> float:
    """Dahl torque in N m of all frictions together after a travel in rad (exact)."""
    return dahl_over(friction, travel, ports.friction_level(x, row), ports.friction_travel(x, row))


@scalar
def contact_impulse(play: float, approach: float, half_gap: float, compliance: float, dt: float) -> float:
    """Impulse in N m s that the motor gives the wheel, so that the play stays within its gap over dt seconds.

    ``play`` is motor minus wheel angle in rad, ``approach`` its rate in rad/s without contact; ``compliance`` in
    1/(kg m2) is 1/J of the motor (0 where its motion is prescribed) plus 1/J of the wheel. Flanks push and do not pull,
    and the contact is inelastic: afterwards the play reaches the flank at the end of the step at the earliest.
    """
    ahead = play + dt * approach
    beyond = ahead - min(max(ahead, -half_gap), half_gap)
    return beyond / (dt * compliance)


@scalar
def resisting_torque(x: RigMoment, friction: float, row: Any) -> float:
    """Torque in N m that resists besides J q'' and b q'."""
    return friction + ports.torque(x, row)
