"""Dahl and LuGre friction against Eq. 15, and what friction must never do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from steer_env.physics.friction import dahl_step, lugre_step, lugre_torque, stribeck_level
from steer_env.physics.plant import bristle_damping, bristle_torque
from steer_env.physics.steering import Steering

repeatable = settings(derandomize=True, deadline=None, max_examples=300, database=None)
levels = st.floats(0.01, 20.0)
stiffnesses = st.floats(0.1, 1e5)
steps = st.floats(-1.0, 1.0)


@repeatable
@given(st.lists(steps, max_size=40), levels, stiffnesses)
def test_dahl_friction_never_exceeds_the_coulomb_level(displacements, M_C, c_fric):
    """Catches the paper's numerical limit: explicit steps of Eq. 15 overshoot M_C, then diverge."""
    torque = 0.0
    for displacement in displacements:
        torque = dahl_step(torque, displacement, M_C, c_fric)
        assert abs(torque) <= M_C


@pytest.mark.parametrize("start", [-2.4, 0.0, 1.0, 2.4])
@pytest.mark.parametrize("displacement", [-0.05, -0.002, 0.001, 0.03])
def test_dahl_step_equals_a_fine_integration_of_eq_15(start, displacement):
    """Catches a wrong exponent or sign: dM/dx = c - (M / M_C) c s, integrated over the path."""
    M_C, c_fric = 2.494, 200.0
    s = math.copysign(1.0, displacement)
    path = solve_ivp(
        lambda x, M: s * c_fric * (1.0 - s * M / M_C),
        (0.0, abs(displacement)),
        [start],
        rtol=1e-11,
        atol=1e-13,
    )
    assert dahl_step(start, displacement, M_C, c_fric) == pytest.approx(path.y[0, -1], abs=1e-9)


@repeatable
@given(st.floats(-1.0, 1.0), steps, st.floats(0.0, 1.0), levels, stiffnesses)
def test_dahl_depends_on_the_path_and_not_on_its_pieces(share, displacement, cut, M_C, c_fric):
    """Rate independence: a sweep sampled coarse or fine, slow or fast, ends at the same torque."""
    start = share * M_C
    whole = dahl_step(start, displacement, M_C, c_fric)
    first = dahl_step(start, cut * displacement, M_C, c_fric)
    second = dahl_step(first, displacement - cut * displacement, M_C, c_fric)
    assert second == pytest.approx(whole, abs=1e-12 * M_C * (1.0 + c_fric / M_C))


def test_dahl_stiffness_at_zero_torque_is_c_fric():
    """Catches a factor in the exponent; c_fric is what a hand feels at a reversal through zero."""
    slope = dahl_step(0.0, 1e-7, 2.5, 200.0) / 1e-7
    assert slope == pytest.approx(200.0, rel=1e-5)
    assert dahl_step(1.3, 0.0, 2.5, 200.0) == 1.3
    assert dahl_step(-1.3, -0.0, 2.5, 200.0) == -1.3
    assert dahl_step(0.5, 0.1, 0.0, 200.0) == 0.0  # switched off


def test_dahl_loop_is_passive():
    """A cycle takes work: 4 M_C per radian of amplitude, less what two reversals give back."""
    M_C, c_fric, reach = 2.5, 300.0, 1.0
    x = reach * np.sin(np.linspace(0.0, 6.0 * np.pi, 60001))
    torque, work = 0.0, []
    for displacement in np.diff(x).tolist():
        new = dahl_step(torque, displacement, M_C, c_fric)
        work.append(0.5 * (torque + new) * displacement)
        torque = new
    # After a reversal M = M_C (1 - 2 exp(-c x / M_C)): 2 M_C^2 / c is missing from the rectangle.
    cycle = 4.0 * M_C * reach - 2.0 * 2.0 * M_C * M_C / c_fric
    assert sum(work[20000:40000]) == pytest.approx(cycle, rel=1e-5)


BRISTLE = {"M_C": 2.0, "M_S": 3.0, "stribeck_rate": 0.1, "sigma_0": 500.0}


@pytest.mark.parametrize("rate", [-5.0, -0.05, 0.001, 0.1, 2.0])
def test_lugre_settles_at_the_stribeck_curve(rate):
    """Catches a wrong sign or level: sliding friction is M_C at speed and M_S near standstill."""
    deflection = 0.0
    for _ in range(20):
        deflection = lugre_step(deflection, rate, 100.0, **BRISTLE)  # exact for any step
    torque = lugre_torque(deflection, rate, sigma_1=0.7, **BRISTLE)
    level = 2.0 + 1.0 * math.exp(-((rate / 0.1) ** 2))
    assert torque == pytest.approx(math.copysign(level, rate), rel=1e-9)
    assert stribeck_level(rate, 2.0, 3.0, 0.1) == pytest.approx(level, rel=1e-14)


@repeatable
@given(st.lists(st.floats(-50.0, 50.0), max_size=30), st.floats(1e-5, 0.1), stiffnesses)
def test_lugre_bristle_torque_stays_below_static_friction(rates, dt, sigma_0):
    """Catches the explicit step, which diverges where sigma_0 |v| dt / g > 2."""
    deflection = 0.0
    for rate in rates:
        deflection = lugre_step(deflection, rate, dt, 2.0, 3.0, 0.1, sigma_0)
        assert abs(sigma_0 * deflection) <= 3.0 * (1.0 + 1e-12)
    assert lugre_step(0.001, 0.0, dt, 2.0, 3.0, 0.1, sigma_0) == 0.001  # stuck: no drift


@repeatable
@given(st.lists(st.floats(-20.0, 20.0), max_size=30), levels, stiffnesses)
def test_lugre_without_stribeck_and_bristle_damping_is_dahl(rates, M_C, c_fric):
    """Two friction laws, one limit: M_S = M_C and sigma_1 = 0 must give Eq. 15."""
    dt, deflection, torque = 1e-3, 0.0, 0.0
    for rate in rates:
        deflection = lugre_step(deflection, rate, dt, M_C, M_C, 0.1, c_fric)
        torque = dahl_step(torque, rate * dt, M_C, c_fric)
        bristle = lugre_torque(deflection, rate, M_C, M_C, 0.1, c_fric, 0.0)
        assert bristle == pytest.approx(torque, abs=1e-9 * M_C)


def test_lugre_in_the_plant_is_lugre_of_the_textbook():
    """Catches a wrong level, sign or damping where LuGre replaces Dahl on the lower body."""
    p = Steering(M_fric=1.5, M_fric_extra=0.8, sigma_1=0.3, stribeck_rate=0.2, c_fric=120.0)
    z, torque, dt = 0.0, 0.0, 1e-4
    for k in range(4000):
        rate = 0.5 * math.cos(8.0 * k * dt)
        z = lugre_step(z, rate, dt, 1.5, 2.3, 0.2, 120.0)
        torque = bristle_torque(torque, rate * dt, rate, p)
        assert torque == pytest.approx(120.0 * z, abs=1e-9)
        total = torque + bristle_damping(torque, rate, p)
        assert total == pytest.approx(lugre_torque(z, rate, 1.5, 2.3, 0.2, 120.0, 0.3), abs=1e-9)


def test_dahl_is_lugre_without_stribeck_and_bristle_damping():
    """Catches a switch that changes the default friction."""
    p = Steering()
    assert bristle_torque(0.7, 0.01, 3.0, p) == dahl_step(0.7, 0.01, p.M_fric, p.c_fric)
    assert bristle_damping(0.7, 3.0, p) == 0.0
