"""h_infinity: its gamma, its robustness to the arm, the steps from synthesis to law, and what it is good for."""

from dataclasses import replace
from functools import cache, partial
from itertools import product

import control
import numpy as np
import pytest

import controllers
from controllers import CAUSALITIES, h_infinity_plant, synthesis
from controllers.h_infinity_design import felt_of, weights_for
from controllers.h_infinity_plant import ARM_LIMIT, DISTURBANCES, RESULTS, Weights
from controllers.h_infinity_sampled import ANGLE_SIZE, ORDER, TORQUE_SIZE, growth, sampled_response
from controllers.hardware import total_delay
from controllers.schedule import schedule_of
from experiments.bench_cases import Case, result_of
from experiments.bench_gates import unstable_share
from experiments.law_half import law_half
from experiments.linear_loop import closed_loop, environment_half, modes
from experiments.operating_points import POINTS, place_of
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.errors import InputError
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Reference

LOOPS = list(product(PLANTS, CAUSALITIES))
PERIOD = 1e-3


@cache
def reference():
    return Reference.load("published")


@cache
def made(plant, causality):
    return controllers.make("h_infinity", PLANTS[plant], reference(), causality, tuned=False)


@cache
def problem_of(plant, causality):
    """(Open ports, closed problem) of a shipped design."""
    p = made(plant, causality).parameters
    weights = Weights(*(getattr(p, name) for name in Weights._fields))
    leak = p.leak if causality == "impedance" else 0.0
    ports = h_infinity_plant.ports(PLANTS[plant], felt_of(schedule_of(reference())), weights, leak)
    time = h_infinity_plant.delay(PLANTS[plant], PERIOD) + weights.late
    return ports, h_infinity_plant.problem(ports, time)


def norm_of(q, k, omega):
    """Largest singular value of the loop over omega [f] in rad/s, closed by python-control."""
    n_w, n_z = q.B1.shape[1], len(q.C1)
    D = np.block([[np.zeros((n_z, n_w)), q.D12], [q.D21, np.zeros((len(q.C2), 1))]])
    plant = control.ss(q.A, np.hstack([q.B1, q.B2]), np.vstack([q.C1, q.C2]), D)
    law = control.ss(k.A + k.B_u @ k.C, k.B_y, k.C, np.zeros((1, len(q.C2))))
    loop = plant.lft(law)
    assert loop.poles().real.max() < 0.0
    return np.linalg.svd(np.moveaxis(loop(1j * omega), 2, 0), compute_uv=False).max()


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_the_gamma_reported_is_the_norm_of_the_loop(plant, causality):
    """Catches a bound that the loop does not keep, and losses on the way to the law that nobody sees."""
    achieved = made(plant, causality).parameters.achieved
    ports, q = problem_of(plant, causality)
    full, gamma = synthesis.synthesise(q)
    assert gamma == achieved.gamma
    exact = norm_of(q, full, np.geomspace(0.02, 3000.0, 3000))
    assert exact <= gamma * 1.001
    assert achieved.gamma_full == pytest.approx(exact, rel=0.005)
    assert achieved.gamma_reduced < 1.15 * achieved.gamma_full
    assert achieved.order == ORDER < achieved.order_full
    # Sampled: another grid, and the loop's own eigenvalues.
    p = made(plant, causality).parameters
    omega = np.geomspace(0.1, np.pi / PERIOD, 1500)
    law = synthesis.peak(sampled_response(ports, p.step, p.output, PLANTS[plant], PERIOD, omega))
    assert law == pytest.approx(achieved.gamma_sampled, rel=0.02)
    assert growth(ports, p.step, p.output, PLANTS[plant], PERIOD) < 1.0


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_what_truncation_changes_keeps_to_its_bound(plant, causality):
    """In the units of the scale; and the law is the truncated controller at low frequency, where it matters."""
    p = made(plant, causality).parameters
    _, q = problem_of(plant, causality)
    full, _ = synthesis.synthesise(q)
    scale = np.array([1.0, ANGLE_SIZE, TORQUE_SIZE])
    small, values = synthesis.truncated(full, ORDER, scale)
    omega = np.geomspace(0.1, 3000.0, 300)
    change = synthesis.response(full.A, np.hstack([full.B_u, full.B_y]) * scale, full.C, omega)
    change -= synthesis.response(small.A, np.hstack([small.B_u, small.B_y]) * scale, small.C, omega)
    assert synthesis.peak(change) <= 2.0 * values[ORDER:].sum() == pytest.approx(p.achieved.truncation)

    own = p.step[:, :ORDER] + np.outer(p.step[:, ORDER], p.output[:ORDER])
    enter = p.step[:, ORDER + 1 :] + np.outer(p.step[:, ORDER], p.output[ORDER + 1 :])
    for w in (1.0, 10.0, 60.0):
        law = p.output[:ORDER] @ np.linalg.solve(np.exp(1j * w * PERIOD) * np.eye(ORDER) - own, enter)
        law = law + p.output[ORDER + 1 :]
        continuous = synthesis.response(small.A + small.B_u @ small.C, small.B_y, small.C, np.array([w]))[0, 0]
        np.testing.assert_allclose(law, continuous, rtol=0.02, atol=0.01 * np.abs(continuous).max())


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_the_arm_cannot_make_the_loop_unstable(plant, causality):
    """The small-gain number, and the program's own loop with arms of any inertia up to the heaviest."""
    assert made(plant, causality).parameters.achieved.arm < 1.0
    arms = [Driver(J, 4.0, 7.0) for J in np.linspace(0.0, ARM_LIMIT, 6)] + [DRIVERS["robot"]]
    for speed, point in product((45.0, 105.0), POINTS):
        place = place_of(PLANTS[plant], causality, reference(), speed, point)
        loops = modes(closed_loop(environment_half(place, arms), law_half(made(plant, causality), place)))
        for arm, loop in zip(arms, loops, strict=True):
            assert loop[0].real < 0.0, f"{speed} km/h, {point}, {arm}: grows with {loop[0]}"


def test_the_arm_is_bounded_by_what_the_design_says():
    """The weight holds both ends of the range, and both results are named as they stand in the matrices."""
    J_0, r = h_infinity_plant.arm_range(PLANTS["EPAS"])
    J_s = PLANTS["EPAS"].steering.J_s
    assert J_0 / (1.0 + r) == pytest.approx(J_s)
    assert J_0 / (1.0 - r) == pytest.approx(J_s + ARM_LIMIT)
    # A quick torque of the hand moves the wheel alone: the bar gets its spring and damper times that, and r of it is
    # the result.
    ports, _ = problem_of("EPAS", "admittance")
    w = 1e5j
    quick = ports.C @ np.linalg.solve(w * np.eye(len(ports.A)) - ports.A, ports.B) + ports.D
    s = PLANTS["EPAS"].steering
    through = r * (s.c_tb + s.b_tb * w) / (J_0 * w * w)
    assert quick[RESULTS.index("arm"), DISTURBANCES.index("hand")] == pytest.approx(through, rel=1e-3)


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_stable_wherever_the_reference_is(plant, causality):
    """All published speeds, on centre and where the assist is steepest, friction stuck and sliding, all arms."""
    speeds = [row.speed_kmh for row in reference().file.rows]

    def share(name):
        return unstable_share(
            lambda *told: controllers.make(name, *told, tuned=False), plant, causality, reference(), speeds
        )

    assert share("h_infinity") <= share("pid")


def test_plants_of_the_spread_with_their_dead_times():
    """Less often unstable than pid with drawn hardware: catches a design that only knows the nominal one."""

    def unstable(name, plant, causality):
        law = controllers.make(name, PLANTS[plant], reference(), causality, tuned=False)
        grows = 0
        for k, speed in product(range(4), (45.0, 105.0)):
            hardware = PLANTS[plant].drawn(np.random.default_rng(k))
            place = place_of(PLANTS[plant], causality, reference(), speed, "centre_stuck", hardware)
            arms = [DRIVERS["relaxed"], DRIVERS["tense"]]
            loops = modes(closed_loop(environment_half(place, arms), law_half(law, place)))
            grows += sum(loop[0].real > 0.0 for loop in loops)
        return grows

    for plant, causality in LOOPS:
        assert unstable("h_infinity", plant, causality) <= unstable("pid", plant, causality), (plant, causality)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_angle_is_followed_twice_as_well_as_by_pid(plant):
    """What the sensed torque in the position loop is for; both with the gains of their own formulas."""

    def error(name):
        case = Case(plant, "admittance", name, 75.0, "frequency_response", "relaxed")
        result = result_of(case, reference(), 1, make=partial(controllers.make, name, tuned=False))
        return result["scores"]["frf_complex"]

    assert error("h_infinity") < 0.5 * error("pid")


def test_it_does_not_wind_up():
    """A motor too weak for what is asked: half a second after its limit the angle is back.

    Without the torque that was really sent, or with the error's integral going on, it swings between
    the limits for good.
    """
    weak = replace(PLANTS["SbW"], motor=PLANTS["SbW"].motor._replace(rated_torque=2.0))
    task = Task(weak, "admittance", reference(), manoeuvre="release", speed_kmh=75.0, duration=8.0)
    controller = controllers.make("h_infinity", weak, reference(), "admittance", tuned=False)
    episode = run(task, controller, seed=1)
    limited = np.flatnonzero(np.abs(episode["command"]) >= 0.999 * 2.0)
    assert limited.size > 1000, "the motor was hardly too weak"
    after = np.abs(episode["error"][limited[-1] + 500 :])
    assert after.size > 1000
    assert after.max() < 0.01 * np.abs(episode["error"]).max()


def test_equal_designs_are_found_once():
    first = made("EPAS", "admittance").parameters
    again = controllers.make("h_infinity", PLANTS["EPAS"], reference(), "admittance", tuned=False).parameters
    assert again.step is first.step
    other = controllers.make(
        "h_infinity", PLANTS["EPAS"], reference(), "admittance", tuned=False, accuracy=0.5 * first.accuracy
    )
    assert other.parameters.step is not first.step
    assert other.parameters.achieved.gamma < first.achieved.gamma


def test_other_periods_and_a_plant_without_delay():
    """Catches weights that belong to one plant, and a delay of no whole period."""
    prompt = replace(
        PLANTS["EPAS"],
        motor=PLANTS["EPAS"].motor._replace(dead_time=0.0),
        sensors=PLANTS["EPAS"].sensors._replace(angle_delay=0.0, torque_delay=0.0),
    )
    for plant, period in ((prompt, 1e-3), (PLANTS["EPAS"], 2e-3)):
        law = controllers.make("h_infinity", plant, reference(), "admittance", tuned=False)
        law.reset(period)
        achieved = law.parameters.achieved
        assert achieved.gamma_sampled < 2.0 * achieved.gamma


def test_weights_are_checked():
    with pytest.raises(InputError, match="out of range"):
        controllers.make("h_infinity", PLANTS["EPAS"], reference(), "impedance", accuracy=-1.0)
    with pytest.raises(InputError, match="there is no gain"):
        controllers.make("h_infinity", PLANTS["EPAS"], reference(), "impedance", speed=1.0)
    assert weights_for(PLANTS["SbW"], False, total_delay(PLANTS["SbW"], PERIOD)).load > 0.0
