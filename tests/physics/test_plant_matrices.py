"""The plant's linear model against formulas on paper."""

import numpy as np
import pytest

from steer_env.physics.linear import plant_matrices
from steer_env.physics.motor import Motor
from steer_env.physics.steering import Steering


def test_two_bodies_on_a_bar_have_the_modes_of_the_formula():
    """Undamped: 0, 0, +-j sqrt(c_tb (1/J_s + 1/J_pin)) and the motor's lag; catches a wrong sign or inertia."""
    steering, motor = Steering(b_s=0.0, b_pin=0.0, b_tb=0.0), Motor(bandwidth_Hz=150.0)
    A, B, _, _ = plant_matrices(steering, motor, J_driver=0.06)
    bar = np.sqrt(steering.c_tb * (1.0 / (steering.J_s + 0.06) + 1.0 / steering.J_pin))
    values = np.linalg.eigvals(A)
    assert max(values.imag) == pytest.approx(bar, rel=1e-9)
    assert min(values.real) == pytest.approx(-2.0 * np.pi * 150.0, rel=1e-9)
    assert A[3, 4] == pytest.approx(steering.motor_ratio / steering.J_pin)
    assert B[1, 1] == pytest.approx(1.0 / (steering.J_s + 0.06))
    assert B[3, 2] == pytest.approx(-1.0 / steering.J_pin)


def test_stuck_friction_is_its_spring():
    """Catches friction on the wrong body: each row gains exactly its own -c / J."""
    s, motor = Steering(), Motor()
    gained = plant_matrices(s, motor, stuck=True)[0] - plant_matrices(s, motor)[0]
    expected = np.zeros((5, 5))
    expected[1, 0], expected[3, 2] = -s.c_s_fric / s.J_s, -s.c_fric / s.J_pin
    np.testing.assert_allclose(gained, expected, atol=1e-9)
