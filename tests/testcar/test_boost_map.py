"""The control unit's boost table and compensation."""

import math

import numpy as np
import pytest

from steer_env.physics.boost_map import (
    KNOT_STEP,
    KNOTS,
    RATE_SMOOTHING,
    Calibration,
    ControlState,
    boost_table,
    boost_torque,
    control_step,
    law_at,
    smooth_boost,
)
from steer_env.units import from_kmh

CALIBRATION = Calibration()
REST = ControlState(0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("speed_kmh", [0.0, 15.0, 52.0, 105.0, 200.0])
def test_boost_is_odd_monotone_and_bounded(speed_kmh: float) -> None:
    """A map that falls anywhere makes the steering jump; one that is not odd pulls."""
    knots = law_at(from_kmh(speed_kmh), CALIBRATION).knots
    torques = np.linspace(0.0, 15.0, 601)
    assist = np.array([boost_torque(M, knots) for M in torques])
    assert (np.diff(assist)[torques[:-1] < (KNOTS - 1) * KNOT_STEP] > 0.0).all()
    assert assist[-1] == knots[-1]
    assert all(boost_torque(-M, knots) == -a for M, a in zip(torques[1:], assist[1:], strict=True))


def test_table_meets_the_law_at_knots_only() -> None:
    """An ECU table is straight between knots: close to the law, but not the law."""
    knots = law_at(from_kmh(75.0), CALIBRATION).knots
    r, width = CALIBRATION.off_centre_ratio[5], CALIBRATION.on_centre_width
    for k in range(KNOTS):
        assert boost_torque(k * KNOT_STEP, knots) == pytest.approx(
            smooth_boost(k * KNOT_STEP, r, width), abs=1e-12
        )
    middle = [
        abs(boost_torque(M, knots) - smooth_boost(M, r, width)) for M in (1.25, 1.75, 2.25, 2.75)
    ]
    assert 0.001 < max(middle) < 0.2


def test_schedule_is_straight_between_speeds() -> None:
    """Half way between two speeds of the table every number is half way."""
    low, high = law_at(from_kmh(60.0), CALIBRATION), law_at(from_kmh(75.0), CALIBRATION)
    between = law_at(from_kmh(67.5), CALIBRATION)
    assert between.active_damping == pytest.approx(0.5 * (low.active_damping + high.active_damping))
    assert between.knots == pytest.approx(
        [0.5 * (a + b) for a, b in zip(low.knots, high.knots, strict=True)]
    )
    assert boost_table(CALIBRATION)[4] == pytest.approx(low.knots)


def test_steady_turning_is_damped_and_freed_of_friction() -> None:
    """At constant rate: friction level minus damping times rate, no inertia torque; inertia torque
    helps motion.
    """
    law = law_at(from_kmh(60.0), CALIBRATION)
    rate, dt, x = 0.5, 1e-3, REST
    for k in range(1, 1500):
        _, compensation, x = control_step(x, 0.0, rate * k * dt, law, dt)
    sign = rate / math.hypot(rate, RATE_SMOOTHING)
    assert compensation == pytest.approx(
        law.friction_compensation * sign - law.active_damping * rate, abs=1e-3
    )


def test_control_is_odd_and_limited() -> None:
    """Mirrored readings give mirrored torques; the sum never passes the limit."""
    law = law_at(from_kmh(30.0), CALIBRATION)
    basic, compensation, _ = control_step(REST, 40.0, 0.02, law, 1e-3)
    mirrored = control_step(REST, -40.0, -0.02, law, 1e-3)
    assert (mirrored[0], mirrored[1]) == (-basic, -compensation)
    tight = law._replace(torque_limit=5.0)
    basic, compensation, _ = control_step(REST, 10.0, 0.02, tight, 1e-3)
    assert basic + compensation == pytest.approx(5.0)
