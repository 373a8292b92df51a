"""The joint refinement: what the paper's steps let leak, it keeps apart."""

from dataclasses import replace

import numpy as np
import pytest

from identification.identify import Options, identify
from identification.refine import equivalent_gain
from tests.identification import independent_campaign as made

DYNAMICS = ("J_ref", "b_ref", "M_fric_C", "sigma_assist", "c_fric")


def truth(car):
    return {"J_ref": car.J_ref, "b_ref": car.b_ref, "M_fric_C": car.M_C, "sigma_assist": car.sigma_assist,
            "c_fric": car.c_fric}  # fmt: skip


def test_friction_and_assist_no_longer_leak():
    """Noise-free with 2.3 N m of friction: step II misses J_ref by 10 % and more, the refinement by less than 0.5 %."""
    cars, _ = made.frictional()
    for car, found in zip(cars, made.identified("frictional"), strict=True):
        assert abs(found.frf["J_ref"] / car.J_ref - 1.0) > 0.10
        for name in DYNAMICS:
            assert found.values[name] == pytest.approx(truth(car)[name], rel=0.005), name
        ratio = found.values["c_pin_off"] / found.values["c_pin_on"]
        assert ratio == pytest.approx(car.assist_ratio, rel=0.005)


def test_small_sweep_doubles_the_damping_of_step_two_only():
    """At 0.1 rad friction rules step II: k_gain falls from 2.4 to 0.7 and damping per assist doubles; refined, not."""
    (car,), campaign = made.small_sweep()
    found = identify(campaign, Options(("per-speed",))).modes["per-speed"][0]
    assert found.frf["b_ref"] / (1.0 + found.frf["k_gain"]) > 2.0 * car.b_ref / (1.0 + car.k_gain)
    assert found.frf["b_ref"] > car.b_ref + 0.1
    assert abs(found.values["b_ref"] - car.b_ref) < 0.05
    assert found.values["k_gain"] == pytest.approx(car.k_gain, rel=0.05)
    assert found.values["M_fric_C"] == pytest.approx(car.M_C, rel=0.05)


def test_noise_and_lags_leave_no_bias():
    """With sensor noise and a lag per sensor group: b_ref within 0.05 N m s/rad, M_C and J_ref within 5 %."""
    cars, _ = made.noisy()
    for car, found in zip(cars, made.identified("noisy"), strict=True):
        assert abs(found.values["b_ref"] - car.b_ref) < 0.05
        assert found.values["M_fric_C"] == pytest.approx(car.M_C, rel=0.05)
        assert found.values["J_ref"] == pytest.approx(car.J_ref, rel=0.05)


def test_without_the_bar_the_inverse_still_beats_step_two():
    """No [steering] table: Eq. 16 is inverted at the measured motion instead, less exact but within 3 %."""
    cars, campaign = made.frictional()
    result = identify(replace(campaign, steering=None), Options(("per-speed",)))
    for car, found in zip(cars, result.modes["per-speed"], strict=True):
        assert "lags" in found.skipped
        for name in ("J_ref", "b_ref", "M_fric_C"):
            assert found.values[name] == pytest.approx(truth(car)[name], rel=0.03), name


def test_linear_car_is_found_by_the_refinement_too():
    """No curve, no friction: a corner far from step III's start, where a local minimum once cost 7 % of J_ref."""
    cars, _ = made.linear()
    for car, found in zip(cars, made.identified("linear"), strict=True):
        assert found.values["J_ref"] == pytest.approx(car.J_ref, rel=0.005)
        assert found.values["b_ref"] == pytest.approx(car.b_ref, rel=0.005)
        assert found.values["k_gain"] == pytest.approx(car.k_gain, rel=0.005)
        assert "M_fric_C" in found.unidentified()


def test_equivalent_gain_is_the_least_squares_gain():
    """A constant curve gives its constant: r = 1/(1+k) with a vanishing sigma; near zero torque the gain vanishes."""
    M = np.linspace(-4.0, 4.0, 2001)
    assert equivalent_gain(M, 0.25, 1e-3) == pytest.approx(3.0, rel=1e-3)
    assert equivalent_gain(1e-3 * M, 0.25, 1.8) == pytest.approx(0.0, abs=1e-5)
