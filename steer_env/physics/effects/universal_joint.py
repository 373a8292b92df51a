"""A cardan joint in the column: the shaft leads and lags twice per turn of the wheel."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class UniversalJoint(NamedTuple):
    """Absent at zero amplitude."""

    amplitude_rad: Annotated[float, Quantity("rad", "amplitude of the angle error", 0.0, 0.2, "absent")] = 0.0
    phase_rad: Annotated[float, Quantity("rad", "phase at straight ahead", -7.0, 7.0, "fitted")] = 0.0


@scalar
def angle(x: Moment, p: UniversalJoint) -> float:
    """Angle in rad that the bar's upper end leads the wheel: A sin(2 delta_s + phi)."""
    if p.amplitude_rad == 0.0:
        return 0.0
    return p.amplitude_rad * math.sin(2.0 * x.steering_angle + p.phase_rad)


@scalar
def slope(x: Moment, p: UniversalJoint) -> float:
    """Its derivative by the wheel angle, by which rates grow and torque passes up."""
    if p.amplitude_rad == 0.0:
        return 0.0
    return 2.0 * p.amplitude_rad * math.cos(2.0 * x.steering_angle + p.phase_rad)


VEHICLE = Effect(
    name="universal_joint",
    kind="vehicle",
    enters="delta_s + A sin(2 delta_s + phi) drives the torsion bar",
    parameters=UniversalJoint,
    amplitude="amplitude_rad",
    plausible={"amplitude_rad": Plausible(0.003, 0.04), "phase_rad": Plausible(0.0, 7.0, signed=True)},
    probes=tuple({"amplitude_rad": 0.01, "phase_rad": phase} for phase in (0.0, 1.57, 3.14, -1.57)),
    ports={"bar_angle": angle, "bar_slope": slope},
    shows_in="second order of the wheel angle",
)
