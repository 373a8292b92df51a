"""The motor gives the wheel no more energy than it was granted, and what it takes it may give back."""

import numpy as np
import pytest

from steer_env.rig.safety import State
from tests.rig.safety_clock import FAST, PERIOD, armed, ask


def test_the_motor_gives_no_more_energy_than_store_and_income():
    """A request that always drives the wheel: the work done stays within store + income t."""
    limits = FAST._replace(energy_store=1.0, energy_income=0.5, angle_limit=30.0)
    layer, clock = armed(limits)
    angle, work, worked, torque = 0.0, 0.0, [], 0.0
    for _ in range(4000):
        angle += 5.0 * PERIOD
        work += torque * 5.0 * PERIOD
        torque = ask(layer, clock, 2.0, angle=angle, rate=5.0)
        worked.append(work)
    assert layer.state is State.ARMED
    allowed = 1.0 + 0.5 * PERIOD * np.arange(1, 4001)
    assert np.all(worked <= allowed)
    assert worked[-1] > 0.9 * allowed[-1]  # and what is allowed is really given
    assert torque == pytest.approx(0.5 / 5.0, rel=0.05)  # in the end the income alone: 0.5 W at 5 rad/s
    assert layer.limited_by == ("energy",)


def test_energy_taken_from_the_wheel_is_given_back_but_not_hoarded():
    """Braking fills the store to its brim and not above."""
    limits = FAST._replace(energy_store=1.0, energy_income=0.0, angle_limit=30.0)
    layer, clock = armed(limits)
    angle = 0.0
    for _ in range(300):  # drives: 2 N m over 1.5 rad would be 3 J
        angle += 5.0 * PERIOD
        ask(layer, clock, 2.0, angle=angle, rate=5.0)
    low = layer.energy
    assert 0.0 <= low < 0.1
    for _ in range(100):
        angle += 5.0 * PERIOD
        ask(layer, clock, -2.0, angle=angle, rate=5.0)
    assert layer.energy == pytest.approx(low + 2.0 * 99 * 5.0 * PERIOD, abs=0.02)
    for _ in range(300):
        angle += 5.0 * PERIOD
        ask(layer, clock, -2.0, angle=angle, rate=5.0)
    assert layer.energy == 1.0


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("rate", [4.0, 0.5, 0.0005])
def test_little_energy_bounds_the_torque_by_what_lasts_for_50_ms(side, rate):
    layer, clock = armed(FAST._replace(energy_income=0.0))
    layer.energy = 0.05 * rate
    assert ask(layer, clock, side * 2.0, rate=-side * rate) == side * 2.0  # against the motion: free
    assert ask(layer, clock, side * 2.0, rate=side * rate) == pytest.approx(side * 1.0)
    assert layer.limited_by == ("energy",)
    layer.energy = -1.0
    assert ask(layer, clock, side * 2.0, rate=side * rate) == 0.0


@pytest.mark.parametrize("energy", [0.0, -1.0])
def test_without_energy_a_wheel_at_rest_may_still_be_pushed(energy):
    """Work needs motion: at rest nothing is spent, and nothing divides by it."""
    layer, clock = armed(FAST._replace(energy_income=0.0))
    layer.energy = energy
    assert ask(layer, clock, 2.0, rate=0.0) == 2.0
