"""Basic assist sets in only beyond a torsion-bar torque."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class AssistDeadzone(NamedTuple):
    """Absent at zero."""

    torque_Nm: Annotated[float, Quantity("N m", "torsion-bar torque where assist sets in", 0.0, 5.0, "absent")] = 0.0


@scalar
def withheld(x: Moment, p: AssistDeadzone) -> float:
    """Torsion-bar torque in N m that the basic assist does not see, negative of it."""
    return -min(max(x.torsion_bar_torque, -p.torque_Nm), p.torque_Nm)


VEHICLE = Effect(
    name="assist_deadzone",
    kind="vehicle",
    enters="assist only beyond a torsion-bar torque",
    parameters=AssistDeadzone,
    amplitude="torque_Nm",
    plausible={"torque_Nm": Plausible(0.1, 1.0)},
    probes=({"torque_Nm": 0.3}, {"torque_Nm": 0.8}),
    ports={"assist_input": withheld},
    bends=True,
    shows_in="steepness on centre",
)
