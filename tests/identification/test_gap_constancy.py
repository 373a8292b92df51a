"""An effect that is named must be the same throughout."""

import numpy as np
import pytest

from identification.gap.constancy import SIZE, TIME, Part, changes_of


def parts(shape, growth, noise: float = 0.02) -> list[Part]:
    """Six channels in which the effect does ``shape`` [n] and ``growth`` [n] of it is left over."""
    rng = np.random.default_rng(4)
    return [Part(k * shape, k * shape * growth + noise * rng.standard_normal(shape.size), 1.0) for k in range(1, 7)]


def test_a_drift_is_no_offset() -> None:
    """An offset that rises from nothing: around its mean it lacks half early on and has half too much late."""
    t = np.linspace(-1.0, 1.0, 4000)
    (change,) = changes_of(parts(np.ones_like(t), t))  # a flat effect has no small and large
    assert change.over == TIME
    assert change.share == pytest.approx(1.0, abs=0.02)
    assert change.error < 0.05


def test_a_curved_sensor_is_no_gain() -> None:
    """A gain of 1 + c |y| on a sine: by energy halves the small third-order mean of |y| is below the large one's."""
    y = np.sin(2.0 * np.pi * 3.0 * np.linspace(0.0, 1.0, 4001))
    found = {change.over: change for change in changes_of(parts(y, np.abs(y) - 0.85))}
    half = np.sort(np.abs(y))
    cut = np.searchsorted(np.cumsum(half**2), 0.5 * np.sum(half**2))
    mean = [np.sum(part**3) / np.sum(part**2) for part in (half[:cut], half[cut:])]
    assert found[SIZE].share == pytest.approx(mean[1] - mean[0], abs=0.02)
    assert abs(found[TIME].share) < 0.05


def test_what_is_constant_is_left_alone() -> None:
    """Only noise is left: no change beyond four of its standard errors, in any split."""
    t = np.linspace(0.0, 1.0, 4000)
    for change in changes_of(parts(np.sin(9.0 * t), np.zeros_like(t))):
        assert abs(change.share) < 4.0 * change.error
