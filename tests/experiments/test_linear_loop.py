"""The two linear halves against the program, against closed forms, and against each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

import controllers
from controllers.law import LawController
from experiments import linear_loop, perfect_tracking
from experiments.arm_radius import SCALES, radius, scaled_arm
from experiments.assessment import assess
from experiments.law_half import law_half
from experiments.loop_simulation import simulated_growth
from experiments.operating_points import POINTS, place_of, slope_at, steady_load, with_arms
from steer_env.envs.layout import PERIOD, STATE
from steer_env.errors import InputError
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Driver
from steer_env.physics.linear import frequency_response, load_matrices, plant_matrices
from steer_env.plants import DRIVERS, PLANTS, Reference

REFERENCE = Reference.load("published")
LOW = 2.0 * np.pi * np.geomspace(0.2, 30.0, 40)


def halves(name, plant, causality, speed_kmh, point, arms, hardware=None):
    controller = controllers.make(name, PLANTS[plant], REFERENCE, causality, tuned=False)
    controller.reset(PERIOD)
    place = place_of(PLANTS[plant], causality, REFERENCE, speed_kmh, point, hardware)
    return linear_loop.environment_half(place, arms), law_half(controller, place), place, controller


def fastest(environment, law, gain=1.0):
    return linear_loop.modes(linear_loop.closed_loop(environment, law, gain))[0][0]


@scalar
def silence(o, x, p):
    """No command, whatever is seen."""
    return 0.0, x


def silent():
    pid = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", tuned=False)
    return LawController(silence, lambda period: pid.parameters, pid.state())


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("causality", controllers.CAUSALITIES)
@pytest.mark.parametrize("arm", ["torque_source", "tense"])
@pytest.mark.parametrize("known_inputs", [1.0, 0.0])
def test_the_program_stays_at_a_stuck_point(plant, causality, arm, known_inputs):
    """Catches an equilibrium that is none: a generator, an observer or a hand that does not fit the rest."""
    measured = replace(PLANTS[plant], observer_known_inputs=known_inputs)
    place = place_of(measured, causality, REFERENCE, 60.0, "peak_stuck")
    states, lines = place.state[None].copy(), place.lines[None].copy()
    command = np.array([place.observation.last_torque_1])
    rows = with_arms(place, [DRIVERS[arm]])
    for _ in range(50):
        seen, truths = linear_loop._one_period(command, rows, states, lines, place)
    for part in linear_loop.PARTS:
        np.testing.assert_allclose(states[0, STATE[part]], place.state[STATE[part]], atol=1e-9)
    np.testing.assert_allclose(seen[0], place.observation, atol=1e-9)
    np.testing.assert_allclose(truths[0, 3], 0.0, atol=1e-9)


def test_the_peak_is_where_the_field_report_has_it():
    """Peak slopes of the published rows (105 to 30 km/h); at 15 km/h the end stop bounds what can be held."""
    for speed, slope in ((105.0, 5.0), (90.0, 6.8), (75.0, 8.6), (60.0, 11.0), (45.0, 21.9), (30.0, 49.0)):
        place = place_of(PLANTS["EPAS"], "impedance", REFERENCE, speed, "peak_stuck")
        assert place.slope == pytest.approx(slope, rel=0.03)
        M = place.observation.torsion_bar_torque
        assert max(slope_at(M - 0.2, place.reference), slope_at(M + 0.2, place.reference)) < place.slope
    low = place_of(PLANTS["EPAS"], "impedance", REFERENCE, 15.0, "peak_stuck")
    held = low.observation.effective_torque / steady_load(15.0 / 3.6, low.reference)[0]
    assert 0.9 * PLANTS["EPAS"].steering.angle_limit < held < PLANTS["EPAS"].steering.angle_limit
    with pytest.raises(InputError, match="centre_stuck"):
        place_of(PLANTS["EPAS"], "impedance", REFERENCE, 75.0, "centre")


@pytest.mark.parametrize(
    ("name", "plant", "causality", "speed", "point", "arm"),
    [
        ("pid", "EPAS", "impedance", 15.0, "centre_stuck", "hands_off"),  # grows, 7.9 Hz
        ("pid", "EPAS", "admittance", 30.0, "peak_stuck", "relaxed"),  # decays, 2.5 Hz
        ("lqg", "EPAS", "admittance", 75.0, "centre_stuck", "relaxed"),  # decays, 4.3 Hz
        ("lqg", "SbW", "admittance", 15.0, "centre_stuck", "relaxed"),  # grows, 16 Hz
        ("pid", "SbW", "impedance", 45.0, "peak_stuck", "torque_source"),  # decays, 5 Hz
        ("open_loop_map", "SbW", "impedance", 45.0, "centre_stuck", "hands_off"),  # grows, 14 Hz
    ],
)
def test_eigenvalues_are_what_the_compiled_program_does(name, plant, causality, speed, point, arm):
    """Catches a half that misses a state or a delay, a law that was settled elsewhere, and a wrong sign."""
    environment, law, place, controller = halves(name, plant, causality, speed, point, [DRIVERS[arm]])
    mode = fastest(environment, law)
    found = simulated_growth(controller, place, DRIVERS[arm], mode.imag / (2.0 * np.pi))
    assert found == pytest.approx(mode.real, rel=0.03, abs=0.03)


def test_sliding_friction_is_no_spring_and_sticking_friction_is():
    """The bare EPAS lower body: torque over angle at low frequency with and without c_fric."""
    s, arms = PLANTS["EPAS"].steering, [perfect_tracking.NO_ARM]
    controller = silent()
    for point, spring in (("centre_stuck", s.c_fric), ("centre_sliding", 0.0)):
        place = place_of(PLANTS["EPAS"], "impedance", REFERENCE, 75.0, point)
        environment = linear_loop.environment_half(place, arms)
        half = linear_loop.closed_loop(environment, law_half(controller, place))
        _, Z = linear_loop.impedances(linear_loop.response(linear_loop.first_of(half), LOW), LOW)
        load = frequency_response(load_matrices(75.0 / 3.6, place.reference), LOW / (2.0 * np.pi))[:, 0, 0]
        jw = 1j * LOW
        np.testing.assert_allclose(Z, s.J_pin * jw + s.b_pin + (spring + load) / jw, rtol=2e-3)


def test_impedance_at_the_wheel_is_that_of_the_matrices():
    """Steer-by-wire without a controller: hand torque over wheel rate, up to 30 Hz, against Eq. 2."""
    plant = PLANTS["SbW"]
    place = place_of(plant, "impedance", REFERENCE, 75.0, "centre_stuck")
    environment = linear_loop.environment_half(place, [perfect_tracking.NO_ARM])
    half = linear_loop.closed_loop(environment, law_half(silent(), place))
    A, B, _, _ = plant_matrices(plant.steering, plant.motor, stuck=True)
    rate = np.zeros((1, len(A)))
    rate[0, 1] = 1.0
    Y = frequency_response((A, B, rate, np.zeros((1, B.shape[1]))), LOW / (2.0 * np.pi))[:, 0, 1]
    found, _ = linear_loop.impedances(linear_loop.response(linear_loop.first_of(half), LOW), LOW)
    assert np.abs(found * Y - 1.0).max() < 5e-3
    assert found.real.min() > 0.0, "passive hardware gives no energy"


@pytest.mark.parametrize(
    ("plant", "causality", "speed", "point"),
    [("EPAS", "impedance", 75.0, "centre_stuck"), ("SbW", "impedance", 105.0, "centre_stuck"),
     ("EPAS", "admittance", 45.0, "peak_sliding"), ("SbW", "admittance", 45.0, "centre_stuck")],
)  # fmt: skip
def test_margins_are_where_eigenvalues_cross(plant, causality, speed, point):
    """The same loop with a little less and a little more than its gain and delay margins, by eigenvalues."""
    arm = DRIVERS["hands_off"]

    def make(*told):
        return controllers.make("pid", *told, tuned=False)

    (found,) = assess(make, plant, causality, REFERENCE, [speed], {"hands_off": arm}, [point])
    environment, law, _, _ = halves("pid", plant, causality, speed, point, [arm])
    factor = 10.0 ** (found.gain_margin_dB / 20.0)
    inside, beyond = (1.0 + share * (factor - 1.0) for share in (0.9, 1.1))
    assert all(fastest(environment, law, gain).real < 0.0 for gain in (inside, 1.0 / inside))
    assert any(fastest(environment, law, gain).real > 0.0 for gain in (beyond, 1.0 / beyond))
    whole = math.floor(found.delay_margin_ms)
    nominal = PLANTS[plant]
    for periods, stable in ((whole, True), (whole + 1, False)):
        late = replace(nominal, motor=nominal.motor._replace(dead_time=nominal.motor.dead_time + periods))
        moved = halves("pid", plant, causality, speed, point, [arm], late)
        assert (fastest(*moved[:2]).real < 0.0) == stable, f"{periods} periods more"


def test_a_heavy_limp_arm_is_the_references_own_fault():
    """105 km/h, K = 1 + k_gain, no friction: the grid is stable, twice its inertia without grip grows slowly."""
    linear = Reference.load("published", True)
    place = place_of(PLANTS["EPAS"], "impedance", linear, 105.0, "centre_sliding")
    grid = perfect_tracking.growths(place, list(DRIVERS.values()))
    assert grid.max() == pytest.approx(-1.43, abs=0.1)
    heavy = perfect_tracking.growths(place, [Driver(J=0.21, b=0.1, k=4.0)])[0]
    assert 0.0 < heavy < 0.25


def test_the_wheel_on_a_rigid_reference_has_its_closed_form():
    """Very stiff bar, no load: (J_s + J + J_ref / K) w' + (b_s + b + b_ref / K) w; catches a wrong K."""
    place = place_of(PLANTS["SbW"], "impedance", REFERENCE, 75.0, "peak_sliding")
    arm, p, s = DRIVERS["tense"], place.reference, place.steering
    A, B, C, D = perfect_tracking.tracked(place, arm)
    high = np.array([1.0, 2.0])  # Hz; the load is taken off by its own response
    rate = frequency_response((A, B, C, D), high)[:, 0, 0]
    jw = 2j * np.pi * high
    load = frequency_response(load_matrices(75.0 / 3.6, p), high)[:, 0, 0]
    felt = (p.J_ref * jw + p.b_ref + load / jw) / place.slope
    expected = (s.J_s + arm.J) * jw + s.b_s + arm.b + arm.k / jw + felt
    np.testing.assert_allclose(1.0 / rate, expected, rtol=2e-3)


def test_the_radius_is_the_first_scale_that_destabilises():
    """Growth s - 1.7 along the scale, and one that is unstable without an arm."""
    assert radius([s - 1.7 for s in SCALES], lambda s: s - 1.7) == pytest.approx(1.7, abs=0.02)
    assert radius([0.1 - s for s in SCALES], lambda s: 0.1 - s) == 0.0
    assert radius([-1.0 for _ in SCALES], lambda s: -1.0) == max(SCALES)
    assert scaled_arm(DRIVERS["tense"], 0.5)[:3] == tuple(0.5 * v for v in DRIVERS["tense"][:3])
    assert set(POINTS) >= {"centre_stuck", "peak_stuck"}
