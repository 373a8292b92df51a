"""Cogging of the motor or meshing of a gear: a torque periodic in the angle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.units import Quantity


class TorqueRipple(NamedTuple):
    """Absent at zero amplitude."""

    amplitude_Nm: Annotated[float, Quantity("N m", "amplitude at the pinion", 0.0, 10.0, "absent")] = 0.0
    order: Annotated[float, Quantity("1/rev", "periods per turn", 1.0, 200.0, "assumption")] = 22.0
    phase: Annotated[float, Quantity("rad", "phase at straight ahead", -7.0, 7.0, "fitted")] = 0.0


@scalar
def ripple(angle: float, p: TorqueRipple) -> float:
    """Torque in N m that resists at an angle in rad: A sin(N angle + phi)."""
    if p.amplitude_Nm == 0.0:
        return 0.0
    return p.amplitude_Nm * math.sin(p.order * angle + p.phase)


@scalar
def at_pinion(x: Moment, p: TorqueRipple) -> float:
    """Ripple torque in N m at the pinion's angle."""
    return ripple(x.pinion_angle, p)


@scalar
def at_motor(x: RigMoment, p: TorqueRipple) -> float:
    """Ripple torque in N m at the motor's angle."""
    return ripple(x.angle, p)


VEHICLE = Effect(
    name="torque_ripple",
    kind="vehicle",
    enters="A sin(N delta + phi) at the pinion",
    parameters=TorqueRipple,
    amplitude="amplitude_Nm",
    plausible={
        "amplitude_Nm": Plausible(0.05, 0.6),
        "order": Plausible(4.0, 60.0),
        "phase": Plausible(0.0, 7.0, signed=True),
    },
    # Orders too far apart to slide from one to the next: the search scans them (identification/gap).
    probes=tuple(
        {"amplitude_Nm": 0.2, "order": float(order), "phase": phase} for order in range(4, 61) for phase in (0.0, 1.57)
    ),
    ports={"pinion_torque": at_pinion},
    shows_in="residual periodic in the angle",
)
RIG = replace(
    VEHICLE,
    kind="rig",
    enters="+ A sin(N q + phi)",
    plausible={
        "amplitude_Nm": Plausible(0.01, 0.6),
        "order": Plausible(4.0, 60.0),
        "phase": Plausible(0.0, 7.0, signed=True),
    },
    ports={"torque": at_motor},
)
