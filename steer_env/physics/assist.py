"""Basic assist and its inverse (Eqs. 13-14): what torsion-bar torque amounts to at the pinion."""

from __future__ import annotations

import math

from steer_env.physics._jit import scalar

# Eq. 14 grows without bound where the identified off-centre stiffness is zero (15 km/h): no data
# stand behind a gain above about 21 (Table 3, 30 km/h), so the gain stops at twice that. Our
# assumption.
K_ASSIST_MAX = 40.0


@scalar
def softening(M_tb: float, r: float, sigma: float) -> float:
    """h(M_tb) = (1 - r) exp(-M_tb^2 / 2 sigma^2) + r, at least 1 / K_ASSIST_MAX (dimensionless).

    ``r`` = c_pin_off / c_pin_on; ``sigma`` in N m is the width of the on-centre region.
    """
    gauss = (1.0 - r) * math.exp(-0.5 * (M_tb / sigma) * (M_tb / sigma)) + r
    return max(gauss, 1.0 / K_ASSIST_MAX)


@scalar
def assist(M_tb: float, r: float, sigma: float) -> float:
    """Effective torque M_eff = K_assist M_tb at the pinion in N m, K_assist = 1 / h (Eq. 14)."""
    return M_tb / softening(M_tb, r, sigma)


@scalar
def incremental_assist(M_tb: float, r: float, sigma: float) -> float:
    """dM_eff / dM_tb: the gain that a loop sees (peaks at 1.5 to 2.3 times c_on / c_off)."""
    gauss = (1.0 - r) * math.exp(-0.5 * (M_tb / sigma) * (M_tb / sigma))
    h = gauss + r
    if h <= 1.0 / K_ASSIST_MAX:
        return K_ASSIST_MAX
    return (h + gauss * (M_tb / sigma) * (M_tb / sigma)) / (h * h)


@scalar
def inverse_assist(M_eff: float, r: float, sigma: float) -> float:
    """The torsion-bar torque in N m whose assist is ``M_eff``: the root of M = M_eff h(M).

    assist() is odd and strictly increasing, so the root is unique and lies between |M_eff| /
    K_ASSIST_MAX (or r) and |M_eff|. Newton's step, with bisection wherever it leaves the bracket;
    ends at machine precision or 60 steps.
    """
    target = abs(M_eff)
    low = target * max(r, 1.0 / K_ASSIST_MAX)
    high = target
    M = min(target, max(low, 2.0 * sigma))
    for _ in range(60):
        error = assist(M, r, sigma) - target
        step = error / incremental_assist(M, r, sigma)
        # Judged before the bracket: at the root its near end is M itself, and bisection would throw
        # the answer back towards the far end.
        if abs(step) <= 1e-15 * target:
            break
        if error > 0.0:
            high = M
        else:
            low = M
        M -= step
        if low >= M or high <= M:
            M = 0.5 * (low + high)
    return math.copysign(M, M_eff)
