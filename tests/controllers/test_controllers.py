"""What every row of CONTROLLERS promises, and the closed loops that the shipped ones must hold."""

from functools import cache
from itertools import product

import numpy as np
import pytest

import controllers
from controllers import CAUSALITIES, CONTROLLERS
from controllers.blocks import Notch, NotchState, notch, notch_step
from experiments import coupled_stability
from experiments.rollout import run
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.task import Task
from steer_env.errors import InputError
from steer_env.interface import Controller, Observation
from steer_env.physics._jit import scalar
from steer_env.plants import DRIVERS, PLANTS, Reference
from tests.controllers.stepped_episode import assert_steps_are_the_rollout

LOOPS = list(product(CONTROLLERS, PLANTS, CAUSALITIES))
LINEAR = [False, True]


@cache
def reference(linear=False):
    return Reference.load("published", linear)


def made(name, plant, causality, linear=False, **gains):
    return controllers.make(name, PLANTS[plant], reference(linear), causality, **gains)


def observations(n, seed=0, size=1.0):
    """Random observations within about what a steering system can show, times ``size``."""
    rng = np.random.default_rng(seed)
    scale = np.array([1.0, 10.0, 200.0, 5.0, 2.0, 20.0, 200.0, 20.0, 0.0, 2.0, 2.0, 2.0, 2.0])
    rows = size * scale * rng.standard_normal((n, len(scale)))
    rows[:, Observation._fields.index("speed")] = rng.uniform(1.0, 50.0, n)
    return [Observation(*row.tolist()) for row in rows]


def torques(controller, seen):
    controller.reset(PERIOD)
    return [controller(observation) for observation in seen]


@pytest.mark.parametrize(("name", "plant", "causality"), LOOPS)
@pytest.mark.parametrize("linear", LINEAR)
def test_the_contract(name, plant, causality, linear):
    """Catches a missing method, hidden state, a NaN, and a left turn that is not a right turn."""
    controller = made(name, plant, causality, linear)
    assert isinstance(controller, Controller)
    seen = observations(60)
    first = torques(controller, seen)
    assert torques(controller, seen) == first, "reset must forget"
    assert torques(made(name, plant, causality, linear), seen) == first, "same object, same torque"
    assert np.isfinite(torques(controller, observations(60, 1, size=100.0))).all()
    mirrored = [Observation(*(-v for v in o))._replace(speed=o.speed) for o in seen]
    np.testing.assert_allclose(torques(controller, mirrored), np.negative(first), rtol=1e-9)


@pytest.mark.parametrize(("name", "plant", "causality"), LOOPS)
def test_at_rest_nothing_is_commanded(name, plant, causality):
    rest = Observation(*[0.0] * 13)._replace(speed=20.0)
    assert torques(made(name, plant, causality), [rest] * 5) == [0.0] * 5


@pytest.mark.parametrize(("name", "plant", "causality"), LOOPS)
def test_python_and_machine_code_give_the_same_bits(name, plant, causality):
    """Catches a law that only looks the same: an int, a power, a numpy function, a global."""
    task = Task(plant, causality, reference(), duration=0.15)
    assert_steps_are_the_rollout(made(name, plant, causality), task)


def test_the_speed_schedule_goes_through_its_rows_and_holds_at_its_ends():
    """Catches an off-by-one row: a controller that takes its neighbour's parameters."""
    from controllers.schedule import felt_at, schedule_of

    schedule = schedule_of(reference())
    for row in schedule:
        np.testing.assert_allclose(felt_at(row[0], schedule), row[1:], rtol=1e-14)
    between = felt_at(0.5 * (schedule[2, 0] + schedule[3, 0]), schedule)
    np.testing.assert_allclose(between, 0.5 * (schedule[2, 1:] + schedule[3, 1:]), rtol=1e-12)
    assert felt_at(0.1, schedule) == tuple(schedule[0, 1:])
    np.testing.assert_allclose(felt_at(99.0, schedule), schedule[-1, 1:], rtol=1e-14)
    one_row = schedule[3:4]
    assert felt_at(5.0, one_row) == tuple(one_row[0, 1:])


def test_the_notch_is_what_its_formula_says():
    """Gain depth/width at its frequency and 1 far from it (Laplace form, prewarped bilinear)."""
    w, t = 2.0 * np.pi * 125.0, np.arange(4000) * PERIOD  # whole periods in 2000 samples
    for omega, gain in ((w, 0.08 / 0.8), (2.0 * np.pi * 5.0, 1.0)):
        p, x, out = notch(w, 0.08, 0.8, PERIOD), NotchState(), []
        for u in np.sin(omega * t):
            y, x = notch_step(float(u), x, p)
            out.append(y)
        tail = np.array(out[2000:])
        assert np.sqrt(2.0 * np.mean(tail**2)) == pytest.approx(gain, abs=0.005)
    assert notch_step(1.7, NotchState(), Notch()) == (1.7, NotchState())


def test_wrong_names_and_gains_say_how_to_mend_them():
    with pytest.raises(InputError, match="open_loop_map, pid"):
        made("pdi", "EPAS", "impedance")
    with pytest.raises(InputError, match="impedance, admittance"):
        made("pid", "EPAS", "both")
    with pytest.raises(InputError, match="torque_gain"):
        made("pid", "EPAS", "impedance", proportional=3.0)
    with pytest.raises(InputError, match="out of range"):
        made("pid", "EPAS", "impedance", torque_gain=-1.0)
    assert made("pid", "EPAS", "impedance", torque_gain=0.5).parameters.torque_gain == 0.5


def test_the_integral_does_not_wind_up():
    """Two seconds of a torque that the motor cannot give must leave nothing in the integral."""
    controller = made("pid", "SbW", "impedance", True, tuned=False)
    limit = PLANTS["SbW"].motor.rated_torque
    held = Observation(*[0.0] * 13)._replace(speed=20.0, effective_torque=200.0, last_torque_1=-limit)
    torques(controller, [held] * 2000)
    assert abs(controller.state().integral) < 0.1 * limit
    free = held._replace(effective_torque=4.0)
    for _ in range(1000):
        free = free._replace(last_torque_1=controller(free))
    assert abs(controller.state().integral) > 0.1 * limit, "and yet it integrates"


@pytest.mark.parametrize(("plant", "causality"), list(product(PLANTS, CAUSALITIES)))
@pytest.mark.parametrize(("speed_kmh", "linear"), [(45.0, False), (75.0, True), (105.0, False)])
def test_pid_is_stable_in_the_small_with_every_arm(plant, causality, speed_kmh, linear):
    """Eigenvalues of the whole loop, friction stuck or absent: catches a gain set for one arm."""
    for arm in DRIVERS:
        task = Task(plant, causality, reference(linear), linear, None, "standstill", speed_kmh, arm)
        fastest = coupled_stability.modes(task, made("pid", plant, causality, linear))[0]
        assert fastest.real < 0.0, f"{arm}: grows with {fastest}"


@pytest.mark.parametrize(("name", "plant", "causality"), LOOPS)
@pytest.mark.parametrize("speed_kmh", [45.0, 105.0])
def test_closed_loops_hold_with_every_driver(name, plant, causality, speed_kmh):
    """Catches a loop that is thrown, or that shakes: ripple is what moves above 20 Hz."""
    from experiments.metrics import METRICS, Trial

    for arm, driver in DRIVERS.items():
        manoeuvre = "random_torque" if driver.k == 0.0 else "on_centre_weave"
        task = Task(plant, causality, reference(), False, None, manoeuvre, speed_kmh, arm, duration=8.0)
        episode = run(task, made(name, plant, causality), seed=1)
        assert episode.stable, arm
        assert np.isfinite(episode.signals).all()
        if name == "pid":
            ripple = METRICS["ripple"].measure(Trial(episode, causality, False, manoeuvre))
            assert ripple < 0.25, f"{arm}: {ripple:.2f} N m of ripple"


@scalar
def silence(o, x, p):
    """No command, whatever is seen."""
    return 0.0, x


def test_the_tool_finds_a_mode_that_is_known():
    """Free wheel on its torsion bar without a controller: the mode of the two-mass formula."""
    s = PLANTS["SbW"].steering
    silent = made("open_loop_map", "SbW", "impedance")
    silent.law = silence
    task = Task("SbW", "impedance", reference(True), True, driver="hands_off", speed_kmh=75.0)
    rates = coupled_stability.modes(task, silent)
    stiff = s.c_tb * (1 / s.J_s + 1 / s.J_pin)
    bar = rates[np.argmin(np.abs(np.abs(rates) - np.sqrt(stiff)))]
    assert abs(bar) == pytest.approx(np.sqrt(stiff), rel=0.02)
    assert Truth._fields[-1] == "unstable"
