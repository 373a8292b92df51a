"""The tyre against what its formula promises in closed form."""

import numpy as np
import pytest

from steer_env.physics.tyre import (
    Tyre,
    cornering_stiffness,
    peak_force,
    pneumatic_trail,
    side_force,
)

TYRE = Tyre()
LOADS = (500.0, 2000.0, 4000.0, 7000.0)


@pytest.mark.parametrize("load", LOADS)
def test_slope_at_the_origin_is_the_cornering_stiffness(load: float) -> None:
    """Catches a wrong B factor: the slope is known in closed form."""
    step = 1e-5
    slope = (side_force(step, load, TYRE) - side_force(-step, load, TYRE)) / (2.0 * step)
    assert slope == pytest.approx(cornering_stiffness(load, TYRE), rel=1e-6)


@pytest.mark.parametrize("load", LOADS)
def test_force_saturates_at_the_friction_limit(load: float) -> None:
    """The largest force over all slips is mu F_z with mu falling in load, and is reached, not
    passed.
    """
    forces = [side_force(slip, load, TYRE) for slip in np.linspace(0.0, 1.0, 4001)]
    mu = TYRE.friction * (1.0 - TYRE.load_loss * (load / TYRE.load_nominal - 1.0))
    assert max(forces) == pytest.approx(mu * load, rel=1e-5)
    assert max(forces) <= peak_force(load, TYRE) * (1.0 + 1e-12)


def test_symmetry_in_slip() -> None:
    """Force is odd, trail is even: a car must not pull to one side."""
    for slip in np.linspace(0.001, 0.3, 20):
        assert side_force(-slip, 4000.0, TYRE) == -side_force(slip, 4000.0, TYRE)
        assert pneumatic_trail(-slip, 4000.0, TYRE) == pneumatic_trail(slip, 4000.0, TYRE)


def test_stiffness_grows_less_than_load_and_peaks_at_its_load() -> None:
    """Load sensitivity: without it load transfer would leave the axle's stiffness unchanged."""
    per_load = [cornering_stiffness(load, TYRE) / load for load in LOADS]
    assert per_load == sorted(per_load, reverse=True)
    assert cornering_stiffness(TYRE.load_of_max, TYRE) == pytest.approx(TYRE.stiffness_max)


def test_trail_falls_with_slip_and_grows_with_load() -> None:
    """Its value at rest is the parameter; at the limit little of it is left."""
    assert pneumatic_trail(0.0, TYRE.load_nominal, TYRE) == TYRE.trail
    trails = [pneumatic_trail(slip, 4000.0, TYRE) for slip in np.linspace(0.0, 0.2, 30)]
    assert trails == sorted(trails, reverse=True)
    assert trails[-1] < 0.4 * trails[0]
    assert pneumatic_trail(0.05, 5000.0, TYRE) > pneumatic_trail(0.05, 4000.0, TYRE)


def test_lifted_wheel_stays_finite() -> None:
    """A wheel without load must not divide by zero, and makes next to no force."""
    assert abs(side_force(0.2, -300.0, TYRE)) < 20.0
    assert pneumatic_trail(0.2, -300.0, TYRE) == 0.0
