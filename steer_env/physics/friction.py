"""Friction with memory: Dahl (exact) and LuGre (exact for a frozen Stribeck curve)."""

from __future__ import annotations

import math

from steer_env.physics._jit import scalar
from steer_env.physics.elementary import exponential


@scalar
def dahl_step(torque: float, displacement: float, M_C: float, c_fric: float) -> float:
    """Dahl friction torque in N m after a displacement in rad (Eq. 15, solved exactly).

    Eq. 15 is rate independent: along a one-way displacement D with s = sign(D) it reads dM/dx = c
    (1 - s M / M_C), so M+ = s M_C + (M - s M_C) exp(-c |D| / M_C). The update is exact and stable
    for every step and every stiffness, which lifts the paper's limit on c_fric. ``torque`` resists
    motion: it has the sign of the displacement. ``M_C`` is the Coulomb level in N m (0 switches
    friction off), ``c_fric`` the stiffness at zero torque in N m/rad.
    """
    if M_C <= 0.0:
        return 0.0
    if displacement == 0.0:
        return torque  # to the last bit, whichever sign the zero has
    limit = math.copysign(M_C, displacement)
    return limit + (torque - limit) * exponential(-(c_fric / M_C) * abs(displacement))


@scalar
def dahl_over(torque: float, displacement: float, M_C: float, travel: float) -> float:
    """``dahl_step`` with the stiffness M_C / ``travel``, in rad; where there is no friction the travel may be 0."""
    if M_C <= 0.0:
        return 0.0
    return dahl_step(torque, displacement, M_C, M_C / travel)


@scalar
def stribeck_level(rate: float, M_C: float, M_S: float, stribeck_rate: float) -> float:
    """Sliding level in N m at a rate in rad/s: M_C + (M_S - M_C) exp(-(rate/stribeck_rate)^2)."""
    ratio = rate / stribeck_rate
    return M_C + (M_S - M_C) * exponential(-ratio * ratio)


@scalar
def lugre_step(
    deflection: float,
    rate: float,
    dt: float,
    M_C: float,
    M_S: float,
    stribeck_rate: float,
    sigma_0: float,
) -> float:
    """LuGre bristle deflection in rad after dt seconds at a constant rate in rad/s.

    z' = v - sigma_0 |v| z / g(v) (Canudas de Wit et al., IEEE TAC 40(3), 1995) is linear in z while
    the rate holds, so the step is exact for any sigma_0 dt. Friction torque follows from
    ``lugre_torque``.
    """
    if rate == 0.0:
        return deflection
    level = stribeck_level(rate, M_C, M_S, stribeck_rate)
    steady = math.copysign(level / sigma_0, rate)
    return steady + (deflection - steady) * exponential(-sigma_0 * abs(rate) * dt / level)


@scalar
def lugre_torque(
    deflection: float,
    rate: float,
    M_C: float,
    M_S: float,
    stribeck_rate: float,
    sigma_0: float,
    sigma_1: float,
) -> float:
    """LuGre torque in N m: sigma_0 z + sigma_1 z' (the body's own b is the viscous part)."""
    level = stribeck_level(rate, M_C, M_S, stribeck_rate)
    deflection_rate = rate - sigma_0 * abs(rate) * deflection / level
    return sigma_0 * deflection + sigma_1 * deflection_rate
