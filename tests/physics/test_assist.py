"""Gaussian assist and its inverse (Eqs. 13-14)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import lambertw

from steer_env.physics.assist import (
    K_ASSIST_MAX,
    assist,
    incremental_assist,
    inverse_assist,
    softening,
)

repeatable = settings(derandomize=True, deadline=None, max_examples=500, database=None)
torques = st.floats(-60.0, 60.0)
ratios = st.one_of(st.just(0.0), st.floats(0.0, 1.0))
widths = st.floats(0.1, 20.0)

# c_pin_off / c_pin_on of Table 3, and the largest dM_eff/dM_tb that follows (field report, 6.4).
PEAK_SLOPES = {
    105: (16.160 / 53.326, 5.0),
    90: (10.541 / 44.452, 6.8),
    75: (6.979 / 35.482, 8.6),
    60: (4.179 / 25.911, 11.0),
    45: (1.735 / 18.765, 21.9),
    30: (0.512 / 10.903, 49.0),
}


@repeatable
@given(torques, ratios, widths)
def test_the_inverse_undoes_the_assist(M_tb, r, sigma):
    """Catches an inverse that stops early or leaves its bracket, at r = 0 (15 km/h) and at the cap.

    Tolerance: the assist's rounding, magnified by at most M K' / M_eff of the inverse's condition.
    """
    M_eff = assist(M_tb, r, sigma)
    assert inverse_assist(M_eff, r, sigma) == pytest.approx(M_tb, rel=1e-12, abs=1e-300)


@repeatable
@given(st.floats(-500.0, 500.0), ratios, widths)
def test_the_assist_undoes_the_inverse(M_eff, r, sigma):
    """The other way round: any effective torque has a torsion-bar torque, whatever the gain."""
    M_tb = inverse_assist(M_eff, r, sigma)
    assert abs(M_tb) <= abs(M_eff)
    # d M_eff / M_eff is the slope over the gain times d M / M: up to (M / sigma)^2 here.
    condition = 1.0 + incremental_assist(M_tb, r, sigma) / K_ASSIST_MAX
    assert assist(M_tb, r, sigma) == pytest.approx(M_eff, rel=2e-13 * condition, abs=1e-300)


@repeatable
@given(st.floats(1e-3, 100.0), widths)
def test_without_off_centre_stiffness_the_inverse_is_lamberts(x, sigma):
    """r = 0: M exp(M^2 / 2 sigma^2) = M_eff has the root sigma sqrt(W((M_eff / sigma)^2))."""
    M_eff = x * sigma
    closed = sigma * math.sqrt(lambertw(x * x).real)
    if math.exp(0.5 * (closed / sigma) ** 2) >= K_ASSIST_MAX:
        closed = M_eff / K_ASSIST_MAX  # beyond the cap
    assert inverse_assist(M_eff, 0.0, sigma) == pytest.approx(closed, rel=1e-12, abs=1e-300)


def test_the_cap_holds_and_is_continuous():
    """Catches overflow at large torque and a jump where the cap starts."""
    sigma = 1.8
    edge = sigma * math.sqrt(2.0 * math.log(K_ASSIST_MAX))
    assert assist(edge * (1 + 1e-9), 0.0, sigma) == pytest.approx(K_ASSIST_MAX * edge, rel=1e-6)
    assert assist(edge * (1 - 1e-9), 0.0, sigma) == pytest.approx(K_ASSIST_MAX * edge, rel=1e-6)
    assert assist(1e3, 0.0, sigma) == K_ASSIST_MAX * 1e3
    assert inverse_assist(K_ASSIST_MAX * 50.0, 0.0, sigma) == pytest.approx(50.0, rel=1e-14)
    assert softening(0.0, 0.2, sigma) == 1.0  # K_assist(0) = 1: no assist on centre


@repeatable
@given(torques, ratios, widths)
def test_incremental_assist_is_the_slope(M_tb, r, sigma):
    """Catches a lost term of the quotient rule; loops are designed on this slope."""
    step = 1e-5 * sigma
    gauss = (1.0 - r) * math.exp(-0.5 * (M_tb / sigma) ** 2)
    kink = abs(gauss + r - 1.0 / K_ASSIST_MAX) < 1e-3
    slope = (assist(M_tb + step, r, sigma) - assist(M_tb - step, r, sigma)) / (2.0 * step)
    if not kink:  # the slope jumps where the cap starts
        assert incremental_assist(M_tb, r, sigma) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("kmh", PEAK_SLOPES)
def test_the_peak_slope_is_what_a_loop_has_to_bear(kmh):
    """Values of the field report, computed there on another programme."""
    r, expected = PEAK_SLOPES[kmh]
    M = np.linspace(0.0, 12.0, 24001)
    peak = max(incremental_assist(m, r, 1.8) for m in M.tolist())
    assert peak == pytest.approx(expected, abs=0.5 if expected == 49.0 else 0.05)
