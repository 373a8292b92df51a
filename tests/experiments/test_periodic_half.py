"""Laws that act every few periods: responses by brute force, margins by the exact modes."""

import numpy as np
import pytest

import controllers
from controllers import policy
from experiments.assessment import assess
from experiments.law_half import law_half
from experiments.linear_loop import Half, environment_half, response
from experiments.operating_points import place_of
from experiments.periodic_half import closed_loops, step_modes, step_response
from experiments.periodic_loop import growing, law_halves
from experiments.z_width import rendered
from steer_env.envs.layout import PERIOD
from steer_env.plants import DRIVERS, PLANTS, Reference
from tests.controllers.made_up_policy import made_up

REFERENCE = Reference.load("published")
SBW = PLANTS["SbW"]


def shipped(*told):
    return controllers.make("policy", *told)


def silent(plant, reference, causality):
    return policy.of(made_up("SbW", causality, size=0.0), plant, reference)


def bare(*told):
    return controllers.make("pid", *told, tuned=False)


def random_halves(count, n=4):
    rng = np.random.default_rng(count)
    return tuple(
        Half(0.25 * rng.standard_normal((n, n)), rng.standard_normal((n, 2)), rng.standard_normal((3, n)),
             rng.standard_normal((3, 2)))
        for _ in range(count)
    )  # fmt: skip


def test_the_response_is_what_a_driven_run_shows():
    """800 steps of exp(j w t) through the periods in turn, projected on exp(j w t): catches periods out of order."""
    halves = random_halves(5)
    omega = 2.0 * np.pi * np.array([3.0, 40.0, 170.0])
    found = step_response(halves, omega)
    for k, w in enumerate(omega):
        for port in range(2):
            x, total = np.zeros(4, dtype=complex), np.zeros(3, dtype=complex)
            for t in range(4000):
                u = np.eye(2)[port] * np.exp(1j * w * t * PERIOD)
                half = halves[t % 5]
                if t >= 2000:
                    total += (half.C @ x + half.D @ u) * np.exp(-1j * w * t * PERIOD) / 2000.0
                x = half.A @ x + half.B @ u
            np.testing.assert_allclose(found[k, :, port], total, atol=0.02 * np.abs(total).max())
    alike = (halves[0],) * 5
    np.testing.assert_allclose(step_response(alike, omega), response(halves[0], omega), rtol=1e-9)


@pytest.mark.parametrize("causality", controllers.CAUSALITIES)
def test_a_policy_that_does_nothing_is_proven_as_its_base_law(causality):
    """Growth, margins, arms, passivity and Z-width: catches a figure that takes one period for all."""
    judged, plain = (assess(make, "SbW", causality, REFERENCE, [75.0]) for make in (silent, bare))
    assert len(judged) == len(plain) > 10
    for mine, other in zip(judged, plain, strict=True):
        assert mine.place == other.place
        for name in ("growth", "gain_margin_dB", "phase_margin_deg", "disk_margin", "delay_margin_ms", "arm_radius",
                     "passivity_gap", "bar_passivity_gap"):  # fmt: skip
            ours, theirs = getattr(mine, name), getattr(other, name)
            assert ours == pytest.approx(theirs, rel=0.02, abs=0.02), (mine.place, name)
    factors = (1.0, 4.0), (1.0, 8.0)
    _, stable = rendered({"silent": silent, "bare": bare}, "SbW", causality, REFERENCE, 75.0, factors)
    np.testing.assert_array_equal(stable["silent"], stable["bare"])


@pytest.mark.parametrize(
    ("speed", "point", "arm"), [(75.0, "centre_sliding", "relaxed"), (30.0, "peak_stuck", "tense")]
)
def test_a_policys_gain_margin_is_where_its_modes_begin_to_grow(speed, point, arm):
    """Catches a margin read off the response at the driving frequency, which leaves out the images of a held action."""
    [found] = assess(shipped, "SbW", "impedance", REFERENCE, [speed], {arm: DRIVERS[arm]}, [point])
    law = shipped(SBW, REFERENCE, "impedance")
    law.reset(PERIOD)
    place = place_of(SBW, "impedance", REFERENCE, speed, point)
    environment, halves = environment_half(place, [DRIVERS[arm]]), law_halves(law, place)

    def grows(dB):
        return step_modes(closed_loops(environment, halves, 10.0 ** (dB / 20.0)))[0][0].real >= 0.0

    assert not any(grows(sign * (found.gain_margin_dB - 0.05)) for sign in (1.0, -1.0))
    assert any(grows(sign * (found.gain_margin_dB + 0.05)) for sign in (1.0, -1.0))


def test_a_policys_delay_margin_is_where_its_modes_begin_to_grow():
    """The program's own dead time, a period more each time, against delays of the linear halves."""
    arm = {"hands_off": DRIVERS["hands_off"]}
    [found] = assess(shipped, "SbW", "impedance", REFERENCE, [105.0], arm, ["centre_sliding"])
    assert found.reference_stable
    whole = int(found.delay_margin_ms)
    assert 1 <= whole <= 5
    here = (105.0, "centre_sliding", "hands_off")
    law = shipped(SBW, REFERENCE, "impedance")
    assert here not in growing(law, "SbW", "impedance", REFERENCE, [105.0], late=whole)
    assert here in growing(law, "SbW", "impedance", REFERENCE, [105.0], late=whole + 1)


def test_half_the_steps_rate_is_no_place_for_a_margin():
    """45 km/h, EPAS: the response comes within 0.04 dB of -1 at 84 Hz, where a step's images are, and nothing grows."""
    arm = {"hands_off": DRIVERS["hands_off"]}
    [found] = assess(shipped, "EPAS", "impedance", REFERENCE, [45.0], arm, ["centre_stuck"])
    assert found.gain_margin_dB > 3.0
    assert found.delay_margin_ms > 1.9
    late = growing(shipped(PLANTS["EPAS"], REFERENCE, "impedance"), "EPAS", "impedance", REFERENCE, [45.0], late=1)
    assert (45.0, "centre_stuck", "hands_off") not in late


def test_a_wrapper_has_the_step_of_the_policy_inside():
    """Catches the passivity controller around a policy taken for a law of one period, with the network in each."""
    law = controllers.make("passivity:policy", SBW, REFERENCE, "impedance")
    place = place_of(SBW, "impedance", REFERENCE, 75.0, "centre_stuck")
    halves = law_halves(law, place)
    assert law.decimation == len(halves) == 5
    acting = [np.abs(half.A - halves[2].A).max() > 1e-3 for half in halves]
    assert acting[0]
    assert not any(acting[1:4])
    plain = controllers.make("passivity", SBW, REFERENCE, "impedance")
    [half] = law_halves(plain, place)
    plain.reset(PERIOD)
    np.testing.assert_array_equal(half.A, law_half(plain, place).A)
