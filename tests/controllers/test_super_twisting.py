"""The super-twisting algorithm against its theory, and the law around it: robust, and without chatter."""

import math
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np
import pytest
from scipy.linalg import eigh, solve_continuous_are
from scipy.optimize import brentq

import controllers
from controllers import CAUSALITIES
from controllers.twisting import MARGIN, pole, twist_step
from experiments.measures import high_passed, rms
from experiments.robustness import assess, safe
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.interface import Observation
from steer_env.plants import DRIVERS, PLANTS, Reference

L = 20.0  # bound on |d'| of the plants here
K2 = MARGIN * L
UNLIMITED = 1e9  # 1/s: no delay, no boundary layer
LOOPS = list(product(PLANTS, CAUSALITIES))


@cache
def reference():
    return Reference.load("published")


def made(name, plant, causality):
    """By the design formulas, so that what is compared does not follow the shipped gains."""
    return controllers.make(name, PLANTS[plant], reference(), causality, tuned=False)


def disturbed(t):
    """A disturbance in the plant's unit with |d'| = L everywhere: a triangle of 0.2 s."""
    return L * (0.05 - abs((t + 0.05) % 0.2 - 0.1))


def slid(start, h, seconds=1.0, d=disturbed):
    """S [n] of s' = u + d, sampled with h; d integrated by its mean over a period."""
    s, v, path = start, 0.0, []
    for k in range(round(seconds / h)):
        u, v = twist_step(s, v, K2, UNLIMITED, h)
        s += h * (u + d((k + 0.5) * h))
        path.append(s)
    return np.array(path)


def reaching_time_bound(s):
    """Upper bound on the reaching time from s and v + d = 0, after Moreno and Osorio (2012).

    V = z' P z with A'P + PA + P B B' P + L^2 C'C + e R = 0 and R = diag(1, r) has V' <= -e z'Rz / |z1| <=
    -e sqrt(z'Rz) <= -e sqrt(V / m), m the largest eigenvalue of P against R: T = 2 sqrt(m V) / e. The
    best e and r are looked for.
    """
    A = np.array([[-math.sqrt(K2), 0.5], [-K2, 0.0]])
    B, C = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    bounds = []
    for e, r in product(np.geomspace(1.0, 1e3, 12), np.geomspace(1e-4, 1e-1, 8)):
        R = np.diag([1.0, r])
        try:
            P = solve_continuous_are(A, B, L * L * C.T @ C + e * R, -np.eye(1))
        except np.linalg.LinAlgError:
            continue
        if np.linalg.eigvalsh(P)[0] > 0.0:
            bounds.append(2.0 * math.sqrt(P[0, 0] * s * eigh(P, R, eigvals_only=True)[1]) / e)
    return min(bounds)


def test_the_gains_meet_both_published_conditions():
    """Levant 1998 and the circle criterion; catches a margin or a k1 that theory does not cover."""
    k1_squared = (2.0 * math.sqrt(K2)) ** 2
    assert K2 > L
    assert k1_squared >= 4.0 * L * (K2 + L) / (K2 - L)
    w = np.linspace(0.0, 100.0, 20001)
    G = 0.5 / (K2 / 2.0 - w**2 + 0.5j * math.sqrt(k1_squared) * w)
    assert np.abs(G).max() < 1.0 / L


@pytest.mark.parametrize("start", [0.2, 1.0])
def test_it_reaches_in_finite_time_within_the_bound_of_theory(start):
    """First-order plant whose disturbance turns as fast as allowed: catches gains or a pole that are too slow."""
    h, bound = 1e-4, reaching_time_bound(start)
    for d in (disturbed, lambda t: 0.0):
        away = np.flatnonzero(np.abs(slid(start, h, 2.0, d)) > 2.0 * K2 * h * h)
        assert (away[-1] + 1) * h < bound < 0.6


def test_what_is_left_falls_with_the_square_of_the_period():
    """Levant's accuracy of second order, |s| of order L h^2: catches explicit Euler's chatter."""
    left = [np.abs(slid(0.2, h, 2.0)[round(1.0 / h) :]).max() for h in (1e-3, 5e-4, 2.5e-4)]
    x = brentq(lambda x: (1.0 - math.exp(-x)) / x - math.sqrt(L / K2), 0.1, 5.0)  # pole times period on a ramp
    assert left[0] == pytest.approx(K2 * 1e-6 / (x * x), rel=0.1)
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.1)
    assert left[1] / left[2] == pytest.approx(4.0, rel=0.1)


def test_a_double_integrator_slides_down_its_surface():
    """e'' = u + d with s = e' + slope e: after reaching, e decays as exp(-slope t) whatever d does."""
    h, slope = 1e-4, 3.0
    e, rate, v, path = 0.1, 0.0, 0.0, []
    for k in range(10000):
        u, v = twist_step(rate + slope * e, v, K2, UNLIMITED, h)
        rate += h * (u - slope * rate + disturbed((k + 0.5) * h))
        e += h * rate
        path.append(e)
    later = np.array(path[5000:10000])
    assert later[-1] / later[0] == pytest.approx(math.exp(-slope * (len(later) - 1) * h), rel=0.002)


def test_it_is_odd_and_bounded():
    """|v' h| <= k2 h and |u - v| <= 2 sqrt(k2 |s|), as in continuous time, at any s and period."""
    for s, v, h in product((0.0, 1e-12, 1e-3, 0.5, 40.0), (0.0, -3.0), (1e-3, 1e-2)):
        for fastest in (10.0, UNLIMITED):
            u, after = twist_step(s, v, K2, fastest, h)
            assert abs(after - v) <= K2 * h * (1 + 1e-12)
            assert abs(u - v) <= 2.0 * math.sqrt(K2 * s) * (1 + 1e-12)
            assert twist_step(-s, -v, K2, fastest, h) == (-u, -after)


@pytest.mark.parametrize("s", [1e-6, 1e-3, 0.1])
def test_the_local_poles_are_where_the_formula_says(s):
    """Matched: on s + h u the poles are exp(-w h) twice; w = sqrt(k2 / |s|), or ``fastest``."""
    h = 1e-3
    for fastest, w in ((UNLIMITED, math.sqrt(K2 / s)), (15.0, min(math.sqrt(K2 / s), 15.0))):
        assert pole(s, K2, fastest) == pytest.approx(w, rel=1e-12)
        u, after = twist_step(s, 0.0, K2, fastest, h)
        step = np.array([[1.0 + h * u / s, h], [after / s, 1.0]])
        z = math.exp(-w * h)
        assert np.poly(step) == pytest.approx([1.0, -2.0 * z, z * z], abs=1e-9)


def test_the_limit_on_the_poles_keeps_a_delay_from_chattering():
    """Integrator behind 5 ms: with poles of 0.1 / T_d it comes to rest; unlimited it goes round and round."""
    h, periods = 1e-3, 5

    def amplitude(fastest):
        s, v, late = 0.05, 0.0, [0.0] * periods
        path = []
        for _ in range(8000):
            u, v = twist_step(s, v, K2, fastest, h)
            late = [*late[1:], u]
            s += h * late[0]
            path.append(s)
        return np.abs(path[6000:]).max()

    assert amplitude(0.1 / (periods * h)) < 1e-9
    assert amplitude(UNLIMITED) > K2 * (periods * h) ** 2


@pytest.mark.parametrize("causality", CAUSALITIES)
def test_the_integrals_wait_while_a_limit_cuts(causality):
    """Two seconds of a torque that the motor cannot give must leave nothing in the integrals."""
    law = made("super_twisting", "SbW", causality)
    limit = PLANTS["SbW"].motor.rated_torque
    held = Observation(*[0.0] * 13)._replace(
        speed=20.0, effective_torque=200.0, reference=1.0, last_torque_1=-limit, last_torque_2=-limit
    )
    law.reset(1e-3)
    for _ in range(2000):
        law(held)
    assert law.state().twist == 0.0
    assert law.state().surface == 0.0
    free = held._replace(effective_torque=4.0)
    for _ in range(100):
        free = free._replace(last_torque_1=law(free))
    assert law.state().twist != 0.0, "and yet it integrates"


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_stable_in_the_small_wherever_the_reference_is(plant, causality):
    """On centre and at the steepest assist, friction stuck or sliding; small motions stay in the boundary layer."""
    gate = safe(assess(partial(controllers.make, "super_twisting"), plant, causality, reference(), (15.0, 30.0, 60.0)))
    assert gate.safe, gate.failures


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
@pytest.mark.parametrize("speed_kmh", [45.0, 105.0])
def test_no_limit_cycle_is_left_after_a_manoeuvre(plant, causality, speed_kmh):
    """Eigenvalues say nothing of a sliding law far from rest: kicked there, and with perfect sensors, it comes back."""
    perfect = PLANTS[plant].sensors._replace(angle_step=0.0, angle_noise=0.0, torque_step=0.0, torque_noise=0.0)
    for arm in ("hands_off", "one_hand_light", "tense"):
        manoeuvre = "random_torque" if DRIVERS[arm].k == 0.0 else "on_centre_weave"
        task = Task(
            plant, causality, reference(), manoeuvre=manoeuvre, speed_kmh=speed_kmh, driver=arm, duration=4.0,
            sensors=perfect,
        )  # fmt: skip
        episode = run(task, made("super_twisting", plant, causality), 1, settle=8.0)
        left = high_passed(episode["torsion_bar_torque"][-1000:], 3.0, 1e-3)
        assert episode.stable
        assert np.abs(left).max() < 2e-3, f"{arm}: {np.abs(left).max():.4f} N m go on"


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_noise_at_rest_makes_no_more_torque_than_it_does_with_pid(plant, causality):
    """Chatter of a sliding law shows first where nothing moves and the sensors quantise."""

    def torque(name):
        task = Task(plant, causality, reference(), manoeuvre="standstill", duration=5.0)
        return rms(run(task, made(name, plant, causality), 1)["torsion_bar_torque"][1000:])

    assert torque("super_twisting") < 1.4 * torque("pid")


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_it_finds_what_the_model_does_not_know(plant, causality):
    """Hardware with twice the friction and damping that the design was told, against pid on the same hardware."""
    nominal = PLANTS[plant]
    worn = nominal.steering._replace(M_fric=2.0 * nominal.steering.M_fric, b_pin=2.0 * nominal.steering.b_pin)
    task = Task(replace(nominal, steering=worn), causality, reference(), manoeuvre="steady_state", duration=10.0)
    error = {name: rms(run(task, made(name, plant, causality), 1)["error"]) for name in ("pid", "super_twisting")}
    assert error["super_twisting"] < 0.7 * error["pid"]
