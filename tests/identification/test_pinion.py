"""Step II and the lag of the torsion bar."""

import numpy as np
import pytest

from identification.frf import Spectra
from identification.pinion import PinionIdentification
from identification.speed_data import responses, runs_by_speed
from identification.stages import Chain
from identification.timing import identify_timing
from identification.vehicle import VehicleIdentification
from tests.identification import independent_campaign as made


def test_noise_free_reference_dynamics_return():
    """J_ref, b_ref and k_gain of a linear reference within 0.5 % from the paper's step alone."""
    cars, _ = made.linear()
    for car, found in zip(cars, made.identified("linear"), strict=True):
        assert found.frf["J_ref"] == pytest.approx(car.J_ref, rel=0.005)
        assert found.frf["b_ref"] == pytest.approx(car.b_ref, rel=0.005)
        assert found.frf["k_gain"] == pytest.approx(car.k_gain, rel=0.005)


@pytest.mark.parametrize("place", range(len(made.SPEEDS_KMH)))
def test_slip_form_changes_the_damping_that_belongs_to_it(place):
    """Kinematic slip has no lag sigma/v, so its b_ref is smaller by about c sigma / v; mixed forms would hide it."""
    cars, campaign = made.linear()
    car, runs = cars[place], runs_by_speed(campaign)[place]
    measured = responses(runs.sweeps, runs.speed, campaign.vehicle)
    chain = VehicleIdentification(campaign.vehicle).fit([measured.vehicle]).chain_
    angle, rate = measured.pinion["pinion_angle"], measured.pinion["pinion_rate"]
    b_ref = {
        slip: PinionIdentification(campaign.vehicle, slip)
        .fit(angle, rate, measured.vehicle.lines, runs.speed, chain)
        .params_["b_ref"]
        for slip in ("relaxed", "kinematic")
    }
    expected = car.C_f * car.n_t / car.i_s**2 * car.sigma_f / car.speed
    assert b_ref["relaxed"] - b_ref["kinematic"] == pytest.approx(expected, rel=0.35)


def test_bar_tells_the_lags_of_torque_and_steering_angle():
    """M_tb = c (delta_s - delta_pin) with the torque 3 ms late and the wheel angle 6 ms early."""
    rng = np.random.default_rng(1)
    f = np.arange(4, 100) * 0.05
    s = 2j * np.pi * f
    pinion = rng.normal(size=(3, f.size)) + 1j * rng.normal(size=(3, f.size))
    torque = (20.0 + 1.5 * s) * pinion
    steer = pinion + torque / (115.0 + 0.3 * s)
    lines = {
        "pinion_angle_rad": pinion,
        "torsion_bar_torque_Nm": torque * np.exp(-s * 0.003),
        "steering_angle_rad": steer * np.exp(s * 0.006),
        "steering_torque_Nm": pinion * (1.0 + 0.1 * s),
    }
    found = identify_timing(Spectra(f, lines), 115.0, 0.3, "run", Chain({})).values
    assert found["delay_bar"] == pytest.approx(0.003, abs=1e-6)
    assert found["delay_steering"] == pytest.approx(-0.006, abs=1e-6)
