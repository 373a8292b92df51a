"""The contact patch is turned on the spot: Dahl friction over pinion travel that fades with speed."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class TyreScrub(NamedTuple):
    """Absent at zero torque."""

    torque_Nm: Annotated[float, Quantity("N m", "level at standstill, at the pinion", 0.0, 100.0, "absent")] = 0.0
    fade_speed_mps: Annotated[float, Quantity("m/s", "speed at which it fell to 1/e", 0.1, 50.0, "assumption")] = 3.0
    travel_rad: Annotated[
        float, Quantity("rad", "pinion angle that winds the patch up", 1e-3, 1.0, "assumption: 0.4 deg at the wheel")
    ] = 0.1


@scalar
def level(x: Moment, p: TyreScrub) -> float:
    """Friction level in N m at a speed: S exp(-v / v0)."""
    if p.torque_Nm == 0.0:
        return 0.0
    return p.torque_Nm * math.exp(-x.speed / p.fade_speed_mps)


@scalar
def travel(x: Moment, p: TyreScrub) -> float:
    """Wind-up in rad of pinion angle: level over stiffness."""
    return 0.0 if p.torque_Nm == 0.0 else p.travel_rad


VEHICLE = Effect(
    name="tyre_scrub",
    kind="vehicle",
    enters="M_rack + Dahl friction of level S exp(-v / v0)",
    parameters=TyreScrub,
    amplitude="torque_Nm",
    plausible={"torque_Nm": Plausible(0.5, 25.0), "fade_speed_mps": Plausible(1.0, 10.0)},
    probes=(
        {"torque_Nm": 3.0, "fade_speed_mps": 3.0, "travel_rad": 0.02},
        {"torque_Nm": 3.0, "fade_speed_mps": 3.0, "travel_rad": 0.2},
        {"torque_Nm": 2.0, "fade_speed_mps": 8.0, "travel_rad": 0.05},
    ),
    ports={"rack_friction_level": level, "rack_friction_travel": travel},
    shows_in="hysteresis at low speed",
)
