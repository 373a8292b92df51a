"""A torsion bar that hardens (or softens) with twist."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.effects.effect import Effect, Plausible
from steer_env.physics.effects.moment import Moment
from steer_env.units import Quantity


class TorsionBarNonlinearity(NamedTuple):
    """Absent at zero."""

    hardening_per_rad2: Annotated[float, Quantity("1/rad2", "h of c_tb (1 + h twist^2)", -1e3, 1e3, "absent")] = 0.0


@scalar
def torque(x: Moment, p: TorsionBarNonlinearity) -> float:
    """Torque in N m beyond c_tb twist: c_tb h twist^3."""
    return x.bar_stiffness * p.hardening_per_rad2 * x.twist * x.twist * x.twist


VEHICLE = Effect(
    name="torsion_bar_nonlinearity",
    kind="vehicle",
    enters="M_tb = c_tb tw (1 + h tw^2)",
    parameters=TorsionBarNonlinearity,
    amplitude="hardening_per_rad2",
    plausible={"hardening_per_rad2": Plausible(10.0, 300.0, signed=True)},
    probes=({"hardening_per_rad2": 50.0},),
    ports={"bar_torque": torque},
    shows_in="twist against torque",
)
