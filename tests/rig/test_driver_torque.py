"""The estimated torque against the true one of the plant that it stands in for."""

import numpy as np
import pytest
from scipy.signal import lfilter

from steer_env.physics import plant
from steer_env.physics.driver import Driver, Hand
from steer_env.physics.motor import lag_decay
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.sensors import measured
from steer_env.physics.steering import torsion_bar_torque
from steer_env.plants import PLANTS
from steer_env.rig.driver_torque import BANDWIDTH_HZ, DriverTorque

SBW = PLANTS["SbW"]
PERIOD = 1e-3


def ridden(hand_at, motor_at, seconds, resolution):
    """(true, estimated) torque [n] of a wheel that a hand and the motor move."""
    x, estimator = plant.PlantState(*[0.0] * 13), DriverTorque(SBW)
    decay = lag_decay(SBW.motor.bandwidth_Hz, 0.25e-3)
    true, estimated = [], []
    for k in range(round(seconds / PERIOD)):
        for half in range(2):
            t = (k + 0.5 * half) * PERIOD
            args = (motor_at(t), decay, hand_at(t), 1.0, 0.0, SBW.steering, Driver(), ReferenceParameters(), 0.5e-3)
            x = plant.plant_step(x, *args)
        true.append(torsion_bar_torque(plant.motion_of(x), SBW.steering))
        angle = measured(x.pinion_angle, resolution, 0.0, 0.0)
        estimated.append(estimator.update(angle, x.motor_torque, PERIOD))
    return np.array(true), np.array(estimated)


def lagged(signal):
    """Through the observer's three equal poles: what an exact plant model leaves of the truth."""
    keep = np.exp(-2.0 * np.pi * BANDWIDTH_HZ * PERIOD)
    for _ in range(3):
        signal = lfilter([1.0 - keep], [1.0, -keep], signal)
    return signal


@pytest.mark.parametrize("frequency", [1.0, 3.0])
def test_it_follows_a_hand_with_its_own_delay_and_no_more(frequency):
    """Motor and hand both at work: the true torque through three poles at 40 Hz.

    To 1 % of its peak and one period of time: torque and angle are sampled at the end of the period they ran through.
    """
    rate = 2.0 * np.pi * frequency
    hand = lambda t: Hand(0.3 * np.sin(rate * t), 0.3 * rate * np.cos(rate * t), 0.0, 1.0)  # noqa: E731
    true, estimated = ridden(hand, lambda t: -0.8 * np.sin(rate * t - 0.5), 2.0, 0.0)
    error = (estimated - lagged(true))[500:]
    assert np.abs(true).max() > 0.5
    assert np.abs(error).max() < (0.01 + rate * PERIOD) * np.abs(true).max()


def test_a_motor_that_moves_a_free_wheel_is_not_taken_for_a_driver():
    """Torque of the motor alone: what is left is the wheel's own inertia and bearing, which M_tb truly carries."""
    hands_off = lambda t: Hand(0.0, 0.0, 0.0, 0.0)  # noqa: E731
    true, estimated = ridden(hands_off, lambda t: 0.5 * np.sin(2.0 * np.pi * 2.0 * t), 2.0, 0.0)
    assert np.abs(estimated - lagged(true))[500:].max() < 0.01


def test_resolution_makes_little_noise():
    """45 urad rms of quantisation at 12500 rad/s2 per rad and 0.006 kg m2: 0.0034 N m rms, in the order of that."""
    slow = lambda t: Hand(0.5 * t, 0.5, 0.0, 1.0)  # noqa: E731
    _, fine = ridden(slow, lambda t: 0.0, 2.0, 0.0)
    _, coarse = ridden(slow, lambda t: 0.0, 2.0, SBW.sensors.angle_step)
    assert 1e-4 < np.std((coarse - fine)[1000:]) < 0.006


def test_at_rest_it_is_exactly_zero():
    assert DriverTorque(SBW).update(0.0, 0.0, PERIOD) == 0.0
    estimator = DriverTorque(SBW)
    estimator.restart(0.4)
    assert estimator.update(0.4, 0.0, PERIOD) == 0.0
    assert estimator.rate == 0.0
