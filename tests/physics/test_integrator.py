"""The plant's integrator: order, closed forms, and what friction does to the order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from experiments.integrator_study import (
    cases,
    chirp,
    reversals,
    run,
    stability_limit,
    torque_error,
)
from steer_env.envs.layout import PERIOD, SUBSTEPS
from steer_env.physics.driver import Driver
from steer_env.physics.motor import Motor
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.steering import Steering
from steer_env.plants import DRIVERS, PLANTS
from tests.physics import machine

START = PlantState(0.3, 2.0, 0.2, -1.0, 0.3, 0.1, 0.02, 0.01, 0.0, 0.0, 0.5, 0.0, 0.0)
DURATION = 0.06


def trajectory(name: str, h: float, smooth: bool, hand: float) -> np.ndarray:
    """States each 1 ms with a motor step and a hand on the wheel, in steps of h seconds."""
    plant, n = PLANTS[name], round(DURATION / h)
    steering = plant.steering
    start = START._replace(pinion_angle=START.steering_angle - 5.0 / steering.c_tb)
    if smooth:
        steering = steering._replace(M_s_fric=0.0, M_fric=0.0)
    states = machine.plant_run(
        start,
        np.tile([hand, 0.0, 0.5, 1.0], (n, 1)),
        np.full(n, 1.0),
        h,
        rack_share=plant.rack_share,
        steering=steering,
        motor=plant.motor,
        driver=DRIVERS["tense"],
    )
    return states[:: round(1e-3 / h)]


def errors(name: str, smooth: bool, step: float, halvings: int) -> np.ndarray:
    """Mean over some hands of the largest error at step, step / 2, ... as a share of the span.

    The mean evens out where in a step a reversal happens to fall. Truth: a step 16 times finer.
    """
    steps = [step / 2**k for k in range(halvings)]
    found = []
    for hand in (-0.3, 0.0, 0.1, 0.2, 0.5):
        exact = trajectory(name, steps[-1] / 16.0, smooth, hand)
        span = np.abs(exact).max(axis=0) + 1e-12
        found.append(
            [np.abs((trajectory(name, h, smooth, hand) - exact) / span).max() for h in steps]
        )
    return np.mean(found, axis=0)


@pytest.mark.parametrize("name", ["EPAS", "SbW"])
def test_order_four_without_friction(name):
    """Catches a stage at the wrong time, and a motor lag that is only first order inside a step."""
    e = errors(name, True, 2.5e-4, 3)
    assert np.log2(e[:-1] / e[1:]) == pytest.approx(4.0, abs=0.25)


@pytest.mark.parametrize("name", ["EPAS", "SbW"])
def test_friction_reversals_cost_order_and_little_else(name):
    """A reversal inside a step is seen by its net displacement only: order about 2, small errors.

    Catches a friction torque frozen over the step, which is first order.
    """
    e = errors(name, False, PERIOD / SUBSTEPS, 5)
    order = np.log2(e[0] / e[-1]) / 4.0
    assert 1.5 < order < 3.5
    assert e[0] < 0.03


def closed_form(p: Steering, motor: Motor, driver: Driver, car: ReferenceParameters, v: float):
    """Nine states: wheel and pinion motion, car, motor torque; inputs hand angle, motor target."""
    J, K = p.J_s + driver.J, car.C_f * car.n_t / car.i_s
    A = np.zeros((9, 9))
    A[0, 1] = A[2, 3] = 1.0
    A[1, :4] = [-(p.c_tb + driver.k) / J, -(p.b_tb + p.b_s + driver.b) / J, p.c_tb / J, p.b_tb / J]
    A[3, :4] = [p.c_tb, p.b_tb, -p.c_tb - K / car.i_s - car.c_extra, -p.b_tb - p.b_pin]
    A[3, 4:6] = [K / v, K * car.l_f / v]
    A[3, 8] = p.motor_ratio
    A[3] /= p.J_pin
    A[4, [5, 6, 7]] = [-v, car.C_f / car.m, car.C_r / car.m]
    A[5, [6, 7]] = [car.C_f * car.l_f / car.J_z, -car.C_r * car.l_r / car.J_z]
    A[6, [2, 4, 5, 6]] = np.array([v / car.i_s, -1.0, -car.l_f, -v]) / car.sigma_f
    A[7, [4, 5, 7]] = np.array([-1.0, car.l_r, -v]) / car.sigma_r
    A[8, 8] = -2.0 * np.pi * motor.bandwidth_Hz
    B = np.zeros((9, 2))
    B[1, 0] = driver.k / J
    B[8, 1] = 2.0 * np.pi * motor.bandwidth_Hz
    return A, B


@pytest.mark.parametrize("speed", [6.0, 29.0])
def test_linear_plant_is_the_matrix_exponential(speed):
    """Without friction and stops the plant is linear: matrices typed here, solved by expm."""
    p = Steering(M_s_fric=0.0, M_fric=0.0)
    motor, driver, car = Motor(), DRIVERS["relaxed"], ReferenceParameters(c_extra=1.6)
    h, n = 1e-4, 3000
    rng = np.random.default_rng(9)
    u = np.repeat(rng.normal(0.0, [0.3, 0.4], (n // 50, 2)), 50, axis=0)
    hands = np.column_stack([u[:, 0], np.zeros(n), np.zeros(n), np.ones(n)])
    start = START._replace(wheel_friction=0.0, pinion_friction=0.0)
    states = machine.plant_run(
        start, hands, u[:, 1], h, speed=speed, steering=p, motor=motor, driver=driver, car=car
    )
    A, B = closed_form(p, motor, driver, car, speed)
    step = expm(np.block([[A * h, B * h], [np.zeros((2, 11))]]))
    x = np.array([*start[:8], start.motor_torque])
    exact = [x]
    for inputs in u:
        x = step[:9, :9] @ x + step[:9, 9:] @ inputs
        exact.append(x)
    exact = np.array(exact)
    span = np.abs(exact).max(axis=0)
    error = np.abs(np.delete(states, [8, 9, 11, 12], axis=1) - exact).max(axis=0) / span
    # The fastest pole of the Runge-Kutta part is v / sigma_f = 927 1/s: an error of (0.093)^5 / 120
    # a step, over the 1 / 0.093 steps that it remembers a jump of the input.
    assert error.max() < 6e-7


@pytest.mark.parametrize("name", PLANTS)
def test_extremes_of_the_spread_stay_stable_with_a_factor_two_in_hand(name):
    """Catches a plant whose draw leaves the integrator's stability region: twice the step holds."""
    plant = PLANTS[name]
    stiff = plant.steering
    for field, (low, high) in plant.spread.items():
        part, key = field.split(".")
        if part == "steering":
            factor = low if key.startswith("J") else high
            stiff = stiff._replace(**{key: getattr(stiff, key) * factor})
    n = 2000
    states = machine.plant_run(
        START,
        *machine.free(n),
        2.0 * PERIOD / SUBSTEPS,
        rack_share=plant.rack_share,
        steering=stiff,
    )
    assert np.isfinite(states).all()
    assert np.abs(states[-1, :4]).max() < np.abs(states[0, :4]).max()


@pytest.mark.parametrize(
    "case", [c for c in cases() if "15000" not in c.name], ids=lambda c: c.name
)
def test_the_chosen_steps_err_less_than_the_sensors_resolve(case):
    """The claim of plant.py, measured anew: two steps a period, also at the spread's stiff ends."""
    for inputs in (chirp(case), reversals(case)):
        states, truth = run(case, inputs, SUBSTEPS), run(case, inputs, 64)
        assert torque_error(case, states, truth)[1] < 0.03  # N m, the rig's torque sensor
        assert np.abs(states - truth)[:, 2].max() < 1.57e-4  # rad, the rig's encoder
        assert 0.25 * stability_limit(case) > PERIOD / SUBSTEPS
