"""Basic assist and its inverse (Eqs. 13-14): what torsion-bar torque amounts to at the pinion."""

from __future__ import annotations

import math

from steer_env.physics._jit import scalar
from steer_env.physics.elementary import exponential

# Eq. 14 grows without bound where the identified off-centre stiffness is zero (15 km/h): no data
# stand behind a gain above about 21 (Table 3, 30 km/h), so the gain stops at twice that. Our
# assumption.
K_ASSIST_MAX = 40.0


@scalar
def softening(M_tb: float, r: float, sigma: float) -> float:
    """h(M_tb) = (1 - r) exp(-M_tb^2 / 2 sigma^2) + r, at least 1 / K_ASSIST_MAX (dimensionless).

    ``r`` = c_pin_off / c_pin_on; ``sigma`` in N m is the width of the on-centre region.
    """
    gauss = (1.0 - r) * exponential(-0.5 * (M_tb / sigma) * (M_tb / sigma)) + r
    return max(gauss, 1.0 / K_ASSIST_MAX)


@scalar
def assist(M_tb: float, r: float, sigma: float) -> float:
    """Effective torque M_eff = K_assist M_tb at the pinion in N m, K_assist = 1 / h (Eq. 14)."""
    return M_tb / softening(M_tb, r, sigma)


@scalar
def incremental_assist(M_tb: float, r: float, sigma: float) -> float:
    """dM_eff / dM_tb: the gain that a loop sees (peaks at 1.5 to 2.3 times c_on / c_off)."""
    gauss = (1.0 - r) * exponential(-0.5 * (M_tb / sigma) * (M_tb / sigma))
    h = gauss + r
    if h <= 1.0 / K_ASSIST_MAX:
        return K_ASSIST_MAX
    return (h + gauss * (M_tb / sigma) * (M_tb / sigma)) / (h * h)


@scalar
def inverse_assist(M_eff: float, r: float, sigma: float) -> float:
    """The torsion-bar torque in N m whose assist is ``M_eff``: the root of M = M_eff h(M).

    assist() is odd and strictly increasing, so the root is unique. In widths of the on-centre region, u = M / sigma and
    y = |M_eff| / sigma, the uncapped law reads u - r y = (1 - r) y exp(-u^2 / 2). The start is a rational fit of the
    root at r = 0 (within 1.3 % up to y = 120, beyond which the cap rules), or r y where that is more. Three steps of
    Halley's rule end within 2e-15 of the root for every r and y; their number is fixed, so that many inverses at once
    compile to vector code. The cap makes the assist a straight line where that is smaller, and its root is then larger.
    """
    target = abs(M_eff)
    y = target / sigma
    held = min(y, 120.0)
    fit = held * (1.0 + (1.988 + 0.1216 * held) * held) / (1.0 + (1.898 + (1.197 + 0.04083 * held) * held) * held)
    u = max(fit, r * y)
    for _ in range(3):
        gauss = (1.0 - r) * y * exponential(-0.5 * u * u)
        error = u - r * y - gauss
        slope = 1.0 + u * gauss
        u -= error * slope / (slope * slope - 0.5 * error * gauss * (1.0 - u * u))
    M = max(u * sigma, target * (1.0 / K_ASSIST_MAX))
    return math.copysign(min(M, target), M_eff)
