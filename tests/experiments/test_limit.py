"""The limit: no controller beats it, and what makes tracking harder raises it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

import controllers
from experiments.law_half import law_half
from experiments.limit import HAND_HZ, hand_spectrum, limits, optimum, problem_of, reached_by
from experiments.operating_points import place_of
from steer_env.manoeuvres import MANOEUVRES
from steer_env.plants import DRIVERS, PLANTS, Reference

LINEAR = Reference.load("published", True)


def problem(plant="SbW", causality="impedance", arm="relaxed", hardware=None):
    told = PLANTS[plant]
    place = place_of(told, causality, LINEAR, 75.0, "centre_sliding", hardware)
    return problem_of(place, DRIVERS[arm], hardware or told)


def test_the_hands_torque_has_the_manoeuvres_size_and_band():
    """Catches a spectrum in wrong units: rms of the manoeuvre, half the power below about the corner."""
    F, g, h = hand_spectrum()
    P = solve_discrete_lyapunov(F, np.outer(g, g))
    assert np.sqrt(h @ P @ h) == pytest.approx(0.5 * MANOEUVRES["random_torque"].parameters.amplitude)
    f = np.array([0.1, HAND_HZ, 4.0 * HAND_HZ])
    z = np.exp(2j * np.pi * f * 1e-3)
    H = np.abs([h @ np.linalg.solve(x * np.eye(len(F)) - F, g) for x in z])
    assert H[1] / H[0] == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert H[2] / H[0] == pytest.approx(1.0 / 16.0, rel=0.02)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("causality", controllers.CAUSALITIES)
def test_no_controller_beats_the_limit(plant, causality):
    """Catches an optimum that is not one, and a controller scored on another problem."""
    found = limits(["pid", "lqg"], LINEAR, [75.0], arms=["relaxed"])
    here = next(one for one in found if (one.plant, one.causality) == (plant, causality))
    assert 0.0 < here.limit_jnd < min(value for value in here.reached.values() if value is not None)


def test_delay_and_noise_raise_the_limit_and_a_weaker_motor_binds():
    """What the limit is made of: each ingredient worse, the limit worse; without a motor the hardware is felt."""
    plant = PLANTS["SbW"]
    least, share = optimum(problem())
    late = replace(plant, motor=plant.motor._replace(dead_time=4.0))
    noisy = replace(plant, sensors=plant.sensors._replace(torque_noise=0.1))
    assert optimum(problem(hardware=late))[0] > 1.1 * least
    assert optimum(problem(hardware=noisy))[0] > 1.05 * least
    weak = optimum(problem()._replace(rating=share * plant.motor.rated_torque))
    assert weak[0] > 2.0 * least
    assert weak[1] <= 1.0 / 3.0


def test_the_linear_error_is_that_of_the_compiled_loop():
    """The Lyapunov equation against 100 s of the loop in time: the same rms within sampling error."""
    found = problem()
    place = place_of(PLANTS["SbW"], "impedance", LINEAR, 75.0, "centre_sliding")
    law = law_half(controllers.make("pid", PLANTS["SbW"], LINEAR, "impedance"), place)
    rng = np.random.default_rng(0)
    x, m = np.zeros(len(found.A)), np.zeros(len(law.A))
    errors = []
    for noise in rng.standard_normal((100_000, found.G.shape[1])):
        u = law.C @ m
        seen = found.observed @ x + found.environment.D[0, : len(found.observed), 0] * u[0]
        errors.append(found.C[:2] @ x)
        x, m = found.A @ x + found.B @ u + found.G @ noise, law.A @ m + law.B @ seen
    error, wanted = np.sqrt(np.mean(np.square(errors), axis=0))
    assert error / wanted / 0.15 == pytest.approx(reached_by(found, law), rel=0.1)


def test_an_unstable_loop_reaches_nothing():
    found = problem("EPAS")
    place = place_of(PLANTS["EPAS"], "impedance", LINEAR, 75.0, "centre_sliding")
    law = law_half(controllers.make("pid", PLANTS["EPAS"], LINEAR, "impedance"), place)
    assert reached_by(found, law._replace(C=-5.0 * law.C)) is None
