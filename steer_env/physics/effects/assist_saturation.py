"""The motor gives no more than a largest assist torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity

NO_LIMIT = 1e6  # N m


class AssistSaturation(NamedTuple):
    """Absent at NO_LIMIT."""

    torque_Nm: Annotated[float, Quantity("N m", "largest assist at the pinion", 0.1, NO_LIMIT, "absent")] = NO_LIMIT


@scalar
def cut(x: Moment, p: AssistSaturation) -> float:
    """Assist torque in N m beyond the limit, negative of it."""
    return min(max(x.assist_torque, -p.torque_Nm), p.torque_Nm) - x.assist_torque


VEHICLE = Effect(
    name="assist_saturation",
    kind="vehicle",
    enters="assist torque limited",
    parameters=AssistSaturation,
    amplitude="torque_Nm",
    plausible={"torque_Nm": Plausible(2.0, 40.0)},
    probes=tuple({"torque_Nm": level} for level in (3.0, 6.0, 10.0, 16.0, 24.0)),
    ports={"assist_output": cut},
    bends=True,
    shows_in="off centre, heavy at large load",
)
