"""Saturating tyre: a short form of the Magic Formula with load sensitivity.

Form and symbols as in H. B. Pacejka, "Tire and Vehicle Dynamics", 3rd ed., chapter 4: side force D
sin(C atan(B a - E (B a - atan B a))), cornering stiffness c_1 sin(2 atan(F_z / c_2)), pneumatic
trail t_0 cos(C_t atan(B_t a)). Pure side slip, no camber, no shifts (the tyre is symmetric). Here a
= tan(slip angle), positive when it makes a force to the left. Relaxation is a first-order lag of
the slip over a distance and belongs to the vehicle's equations.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.units import Quantity

LEAST_LOAD = 10.0  # N: a lifted tyre keeps this load, so that no equation divides by zero


class Tyre(NamedTuple):
    """One tyre; defaults are an ordinary 205 to 225 mm summer tyre on dry road."""

    stiffness_max: Annotated[
        float,
        Quantity("N/rad", "cornering stiffness at its best load, c_1", 1e4, 4e5, "assumption"),
    ] = 84000.0
    load_of_max: Annotated[
        float, Quantity("N", "load of the best cornering stiffness, c_2", 1e3, 3e4, "assumption")
    ] = 7500.0
    friction: Annotated[float, Quantity("-", "peak friction at the nominal load", 0.1, 2.0, "assumption: dry")] = 1.05
    load_loss: Annotated[
        float,
        Quantity("-", "relative loss of friction per nominal load of extra load", 0.0, 0.5, "assumption"),
    ] = 0.08
    load_nominal: Annotated[float, Quantity("N", "nominal load", 500.0, 2e4, "assumption")] = 4000.0
    shape: Annotated[float, Quantity("-", "shape factor C of the side force", 1.0, 2.0, "Pacejka: about 1.3")] = 1.3
    curvature: Annotated[float, Quantity("-", "curvature factor E of the side force", -10.0, 1.0, "assumption")] = -1.5
    trail: Annotated[float, Quantity("m", "pneumatic trail at nominal load, no slip", 0.0, 0.1, "assumption")] = 0.042
    trail_shape: Annotated[float, Quantity("-", "shape factor C_t of the trail", 0.5, 2.0, "assumption")] = 1.1
    trail_slope: Annotated[float, Quantity("-", "slope factor B_t of the trail", 0.0, 40.0, "assumption")] = 9.0
    relaxation: Annotated[
        float, Quantity("m", "relaxation length", 0.01, 2.0, "assumption: a tyre radius and more")
    ] = 0.45


@scalar
def cornering_stiffness(load: float, p: Tyre) -> float:
    """Side force per slip at no slip in N/rad: c_1 sin(2 atan(F_z / c_2)), written without atan."""
    ratio = load / p.load_of_max
    return p.stiffness_max * 2.0 * ratio / (1.0 + ratio * ratio)


@scalar
def peak_force(load: float, p: Tyre) -> float:
    """Largest side force in N at a load in N (D): friction falls linearly with load."""
    return p.friction * (1.0 - p.load_loss * (load / p.load_nominal - 1.0)) * load


@scalar
def side_force(slip: float, load: float, p: Tyre) -> float:
    """Side force in N at a slip (tan) and a load in N: odd in slip, at most ``peak_force``."""
    held = max(load, LEAST_LOAD)
    peak = peak_force(held, p)
    z = cornering_stiffness(held, p) / (p.shape * peak) * slip
    return peak * math.sin(p.shape * math.atan(z - p.curvature * (z - math.atan(z))))


@scalar
def pneumatic_trail(slip: float, load: float, p: Tyre) -> float:
    """Distance in m from contact centre back to the side force: less with slip, more with load."""
    return p.trail * max(load, 0.0) / p.load_nominal * math.cos(p.trail_shape * math.atan(p.trail_slope * slip))
