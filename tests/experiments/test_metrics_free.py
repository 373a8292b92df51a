"""Free control after a release, against the closed form of a damped oscillator."""

import numpy as np
import pytest

from experiments.measures_free import damping_ratio, free_control, turning_points
from experiments.metrics import METRICS, score
from steer_env.envs.layout import PERIOD
from tests.experiments.trials import trial

RELEASE = 999


def swing(damping, t, frequency_Hz=1.3):
    """Free motion of an oscillator from rest at 1: turning points every half period, each exp(-pi z / w) lower."""
    omega = 2.0 * np.pi * frequency_Hz
    fast = np.sqrt(1.0 - damping**2)
    wave = np.cos(fast * omega * t) + damping / fast * np.sin(fast * omega * t)
    return np.exp(-damping * omega * t) * wave


def held_then(free, seconds=6.0):
    """1 for a second, then ``free`` of the time since the release."""
    t = PERIOD * np.arange(-RELEASE, round(seconds / PERIOD))
    return np.where(t > 0.0, free(np.maximum(t, 0.0)), 1.0)


@pytest.mark.parametrize("damping", [0.1, 0.3, 0.5])
def test_overshoot_damping_and_settling_of_an_oscillator(damping):
    motion = held_then(lambda t: swing(damping, t), seconds=12.0)
    found = free_control(0.2 * motion, -0.1 * motion, RELEASE, PERIOD)
    assert found.overshoot == pytest.approx(100.0 * np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)), rel=1e-3)
    assert found.damping == pytest.approx(damping, rel=0.01)
    assert found.residual == pytest.approx(0.0, abs=np.degrees(0.2) * 0.02)
    after = np.abs(motion[RELEASE:])
    last = round(found.settling / PERIOD)
    assert np.all(after[last:] <= 0.0501)
    assert after[last - 2] > 0.0499


def test_a_wheel_that_friction_holds():
    """Ends at 30 % of the angle: that is left over, and neither overshoot nor damping mistake it for a swing."""
    motion = held_then(lambda t: 0.3 + 0.7 * swing(0.3, t))
    found = free_control(np.radians(10.0) * motion, motion, RELEASE, PERIOD)
    assert found.residual == pytest.approx(3.0, rel=1e-3)
    assert found.overshoot == 0.0, "0.7 times 37 % does not reach the other side"
    assert found.damping == pytest.approx(0.3, rel=0.01)


def test_settling_of_a_creeping_wheel():
    """exp(-t / T) is within 5 % of where it comes to rest after T ln 20."""
    motion = held_then(lambda t: np.exp(-t / 0.5))
    found = free_control(motion, motion, RELEASE, PERIOD)
    assert found.settling == pytest.approx(0.5 * np.log(20.0), abs=2.0 * PERIOD)
    assert np.isnan(found.damping), "it does not swing"
    assert found.overshoot == 0.0


def test_turning_points_leave_small_ones_out():
    """Catches noise on a slope that is counted as a swing: the least has to be passed, up and down in turn."""
    motion = np.array([1.0, 0.0, -0.5, -0.495, -0.6, 0.0, 0.2, 0.19, 0.25, 0.1, 0.11, 0.1])
    np.testing.assert_allclose(turning_points(motion, 0.02), [1.0, -0.6, 0.25, 0.1])
    assert np.isnan(damping_ratio(np.linspace(1.0, 0.0, 50)))


def test_without_motion_or_time_nothing_can_be_told():
    still = np.zeros(5000)
    assert np.isnan(free_control(still, still, RELEASE, PERIOD)).all()
    motion = held_then(lambda t: swing(0.3, t), seconds=0.1)
    assert np.isnan(free_control(motion, motion, RELEASE, PERIOD)).all()


def test_a_motion_that_grows_has_no_numbers():
    """The reference's own damping is negative at 15 km/h: with a soft bar and no hands the ideal drive diverges."""
    growing = held_then(lambda t: np.exp(5.0 * t) * np.cos(60.0 * t))
    assert np.isnan(free_control(growing, growing, RELEASE, PERIOD)).all()
    assert np.isnan(free_control(np.where(growing > 10.0, np.inf, growing), growing, RELEASE, PERIOD)).all()


def test_a_trial_looks_from_the_release_on():
    """The hand of the release manoeuvre lets go at 3.5 s: what swings before does not count."""
    t = PERIOD * np.arange(1, 9501) - 3.5
    motion = np.where(t > 0.0, swing(0.2, np.maximum(t, 0.0)), 1.0)
    motion[:1000] = -2.0
    found = score(trial("release", steering_angle=np.radians(8.0) * motion, yaw_rate=0.05 * motion))
    assert found["overshoot"] == pytest.approx(100.0 * np.exp(-np.pi * 0.2 / np.sqrt(0.96)), rel=1e-3)
    assert found["yaw_damping"] == pytest.approx(0.2, rel=0.01)
    assert found["residual_angle"] < 0.1
    assert METRICS["yaw_damping"].manoeuvres == ("release",)
