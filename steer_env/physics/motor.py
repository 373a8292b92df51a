"""Motor with its current loop: torque limit, slew limit, dead time and first-order lag."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.elementary import exponential
from steer_env.units import Quantity


class Motor(NamedTuple):
    """Defaults are an EPAS motor (torques at its own shaft)."""

    rated_torque: Annotated[float, Quantity("N m", "torque limit at the motor shaft", 0.01, 50.0, "assumption")] = 5.0
    slew_rate: Annotated[float, Quantity("N m/s", "fastest change of the command", 1.0, 1e6, "assumption")] = 1000.0
    bandwidth_Hz: Annotated[float, Quantity("Hz", "current loop, first order", 20.0, 5000.0, "assumption")] = 200.0
    dead_time: Annotated[float, Quantity("periods", "command delay in control periods", 0, 15, "assumption")] = 1.0


@scalar
def limited_command(command: float, last: float, p: Motor, dt: float) -> float:
    """Command in N m after the slew and torque limits; ``last`` is the one before."""
    step = p.slew_rate * dt
    slewed = min(max(command, last - step), last + step)
    return min(max(slewed, -p.rated_torque), p.rated_torque)


@scalar
def lag_decay(bandwidth_Hz: float, dt: float) -> float:
    """What a first-order lag keeps of its distance to a constant target after dt seconds."""
    return exponential(-2.0 * math.pi * bandwidth_Hz * dt)


@scalar
def lag_step(value: float, target: float, decay: float) -> float:
    """First-order lag with a constant target, exact for any step."""
    return target + (value - target) * decay
