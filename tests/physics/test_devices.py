"""Motor, sensors, observer, driver, end stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import lfilter

from steer_env.physics.driver import Driver, driver_torque
from steer_env.physics.linear import jacobian
from steer_env.physics.motor import Motor, lag_decay, lag_step, limited_command
from steer_env.physics.sensors import Observer, ObserverState, measured, observer_step
from steer_env.physics.steering import Steering, end_stop_torque
from steer_env.plants import DRIVERS

repeatable = settings(derandomize=True, deadline=None, max_examples=300, database=None)
DT = 1e-3


@repeatable
@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=50))
def test_motor_commands_respect_slew_and_torque_limits(commands):
    """Catches a limit applied to one side, or in the wrong order."""
    p, last = Motor(rated_torque=5.0, slew_rate=1000.0), 0.0
    for command in commands:
        new = limited_command(command, last, p, DT)
        assert abs(new) <= 5.0
        assert abs(new - last) <= 1000.0 * DT * (1 + 1e-12)
        if abs(command) <= 5.0 and abs(command - last) <= 0.999:
            assert new == command  # nothing is taken away inside the limits
        last = new


def test_motor_lag_is_the_closed_form_for_any_step():
    """Catches Euler's lag: after 1/(2 pi f) s, 1 - 1/e of a step is there, in 1 or 1000 steps."""
    f = 200.0
    T = 1.0 / (2.0 * math.pi * f)
    for n in (1, 7, 1000):
        value = 0.0
        for _ in range(n):
            value = lag_step(value, 3.0, lag_decay(f, T / n))
        assert value == pytest.approx(3.0 * (1.0 - math.exp(-1.0)), rel=1e-12)


@repeatable
@given(st.floats(-100.0, 100.0), st.floats(1e-5, 1.0))
def test_quantiser_error_is_at_most_half_a_step_and_odd(value, step):
    """Catches floor in place of rounding (a bias of half a step) and a left-right difference."""
    seen = measured(value, step, 0.0, 0.0)
    assert abs(seen - value) <= 0.5 * step * (1 + 1e-9) + 1e-14 * abs(value)
    assert seen / step == pytest.approx(round(seen / step), abs=1e-6)
    assert measured(-value, step, 0.0, 0.0) == -seen


def test_sensor_noise_has_its_rms():
    """Catches variance in place of rms; the quantiser adds step^2 / 12."""
    draws = np.random.default_rng(1).standard_normal(40000).tolist()
    fine = np.array([measured(0.5, 0.0, 0.02, d) for d in draws])
    assert np.std(fine) == pytest.approx(0.02, rel=0.02)
    coarse = np.array([measured(0.5, 0.03, 0.02, d) for d in draws])
    assert np.std(coarse) == pytest.approx(math.sqrt(0.02**2 + 0.03**2 / 12.0), rel=0.02)


def observer_maps(p: Observer) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x+ = A x + B (angle, M_tb), acceleration = c (x, angle, M_tb), from the function itself."""

    def step(z):
        acceleration, new = observer_step(ObserverState(*z[:3]), z[3], z[4], 0.0, p, DT)
        return (*new, acceleration)

    matrix = jacobian(step, 5)
    return matrix[:3, :3], matrix[:3, 3:], matrix[3]


@pytest.mark.parametrize("bandwidth", [10.0, 40.0, 120.0])
def test_observer_has_its_three_poles_where_it_says(bandwidth):
    """Triple pole exp(-2 pi f dt); its roots move with the cube root of rounding, hence 1e-4."""
    A, _, _ = observer_maps(Observer(J=0.065, b=0.0, bandwidth_Hz=bandwidth))
    z = math.exp(-2.0 * math.pi * bandwidth * DT)
    assert np.linalg.eigvals(A) == pytest.approx(z, abs=1e-4)
    assert np.poly(A) == pytest.approx([1.0, -3.0 * z, 3.0 * z * z, -(z**3)], abs=1e-9)


@pytest.mark.parametrize("known", [0.0, 1.0])
def test_observer_tracks_constant_acceleration_without_bias(known):
    """Whether the torque is measured (known = 1) or must be found as an unknown load (0)."""
    p, acceleration = Observer(J=0.065, b=0.0), 30.0
    x, estimate = ObserverState(0.0, 0.0, 0.0), 0.0
    for k in range(1, 400):
        t = k * DT
        M_tb = known * p.J * acceleration
        estimate, x = observer_step(x, 0.5 * acceleration * t * t, M_tb, 0.0, p, DT)
    assert estimate == pytest.approx(acceleration, rel=1e-6)
    assert x.rate == pytest.approx(acceleration * t, rel=1e-6)
    assert x.angle == pytest.approx(0.5 * acceleration * t * t, rel=1e-9)


def test_observer_needs_no_differentiation_of_what_it_knows():
    """A known torque step shows in the acceleration at once; a filtered difference is late."""
    p = Observer(J=0.065, b=0.0)
    acceleration, _ = observer_step(ObserverState(0.0, 0.0, 0.0), 0.0, 6.5, 0.0, p, DT)
    assert acceleration == pytest.approx(100.0, rel=0.03)


def test_observer_noise_gain_is_what_its_docstring_says():
    """Acceleration noise per rms of white angle and torque noise, from the Lyapunov equation."""
    A, B, c = observer_maps(Observer())
    angle, torque = (solve_discrete_lyapunov(A, np.outer(B[:, k], B[:, k])) for k in (0, 1))
    gain_angle = math.sqrt(c[:3] @ angle @ c[:3] + c[3] ** 2)
    gain_torque = math.sqrt(c[:3] @ torque @ c[:3] + c[4] ** 2)
    rng, x, seen = np.random.default_rng(2), ObserverState(0.0, 0.0, 0.0), []
    for draw in rng.standard_normal(30000).tolist():
        estimate, x = observer_step(x, draw, 0.0, 0.0, Observer(), DT)
        seen.append(estimate)
    assert np.std(seen[500:]) == pytest.approx(gain_angle, rel=0.05)
    said = observer_step.__doc__.split()
    assert f"{round(gain_angle, -2):.0f}" in said
    assert f"{gain_torque:.1f}" in said


def test_without_known_inputs_it_filters_the_second_difference_of_the_angle():
    """(1 - z)^3 / dt^2 q (q - 1)^2 / (q - z)^3, whatever torques, inertia and damping: catches an input that stays."""
    z = math.exp(-2.0 * math.pi * 40.0 * DT)
    angles = np.cumsum(np.random.default_rng(3).standard_normal(300)) * 1e-3
    angles[0] = 0.0  # it starts at rest
    scale = (1.0 - z) ** 3 / (DT * DT)
    expected = lfilter(scale * np.array([1.0, -2.0, 1.0]), np.poly([z, z, z]), angles)
    for J, b, torque in ((0.065, 0.4, 0.0), (0.006, 3.0, 5.0)):
        p, x, seen = Observer(J, b, known_inputs=0.0), ObserverState(0.0, 0.0, 0.0), []
        for angle in angles.tolist():
            estimate, x = observer_step(x, angle, torque, -torque, p, DT)
            seen.append(estimate)
        np.testing.assert_allclose(seen, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@repeatable
@given(*[st.floats(-10.0, 10.0)] * 5, st.floats(0.0, 1.0))
def test_driver_torque_is_limited_and_an_open_hand_gives_only_its_own(a, b, c, d, e, grip):
    """Catches a limit on one side and a grip that leaves damping behind."""
    for p in DRIVERS.values():
        assert abs(driver_torque(a, b, c, d, e, grip, p)) <= p.torque_limit
    p = Driver(torque_limit=30.0)
    assert driver_torque(a, b, c, d, e, 0.0, p) == e
    assert driver_torque(a, b, a, b, 0.0, grip, p) == 0.0  # hand where the wheel is: no torque
    free = driver_torque(a, b, c, d, 0.0, grip, Driver(torque_limit=100.0, b=0.6, k=7.0))
    assert free == pytest.approx(
        min(max(grip * (7.0 * (c - a) + 0.6 * (d - b)), -100.0), 100.0), abs=1e-9
    )


@repeatable
@given(st.floats(-2.0, 2.0), st.floats(-50.0, 50.0))
def test_end_stop_never_pulls_and_is_passive(angle, rate):
    """Catches a damper that holds the wheel back when it leaves the stop."""
    p = Steering(angle_limit=1.0, c_stop=400.0, b_stop=4.0)
    torque = end_stop_torque(angle, rate, p)
    beyond = math.copysign(max(abs(angle) - 1.0, 0.0), angle)
    assert torque * beyond >= 0.0
    assert torque == 0.0 or beyond != 0.0
    assert (torque - 400.0 * beyond) * rate >= -1e-9  # more than the spring only against motion
