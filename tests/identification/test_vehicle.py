"""Step I: the paper's steps, the axle equations, and the sensor lags."""

import numpy as np
import pytest

from identification.axles import Axles, can_balance, fit_lags
from identification.identify import Options, identify
from identification.speed_data import responses, runs_by_speed
from identification.vehicle import VehicleIdentification
from tests.identification import independent_campaign as made

NAMES = ("C_f", "C_r", "sigma_f", "sigma_r", "J_z", "n_t")


def measured(campaign):
    return [responses(r.sweeps, r.speed, campaign.vehicle) for r in runs_by_speed(campaign)]


@pytest.mark.parametrize("place", range(len(made.SPEEDS_KMH)))
def test_noise_free_parameters_return(place):
    """Within 0.5 % at each speed alone, whatever the start values."""
    cars, campaign = made.linear()
    found = VehicleIdentification(campaign.vehicle).fit([measured(campaign)[place].vehicle])
    for name in NAMES:
        assert found.params_[name] == pytest.approx(getattr(cars[place], name), rel=0.005), name
    assert abs(found.params_.get("delay_imu", 0.0)) < 1e-4


def test_paper_steps_alone_come_close():
    """Steps I-a1 to I-b2 hold what a later step changes, so they are near, not exact (2 % away from 60 km/h)."""
    cars, campaign = made.linear()
    found = VehicleIdentification(campaign.vehicle, lags=False).fit([measured(campaign)[1].vehicle])
    for name in ("C_f", "C_r", "n_t", "J_z"):
        assert found.stepwise_.values[name] == pytest.approx(getattr(cars[1], name), rel=0.02), name


def test_all_speeds_as_one_car():
    """Shared mode on one car returns that car."""
    cars, campaign = made.linear()
    found = VehicleIdentification(campaign.vehicle).fit([m.vehicle for m in measured(campaign)])
    for name in NAMES:
        assert found.params_[name] == pytest.approx(getattr(cars[0], name), rel=0.005), name


def test_lags_are_found_to_a_fifth_of_a_millisecond():
    """A wrong sign, or a lag that leaks into the relaxation length, would show."""
    _, campaign = made.noisy()
    data = [m.vehicle for m in measured(campaign)]
    chain = fit_lags([Axles(d.spectra, d.speed, campaign.vehicle) for d in data])
    assert chain.values["delay_imu"] == pytest.approx(made.LATENCIES["latency_imu"], abs=2e-4)
    assert chain.values["delay_rack"] == pytest.approx(made.LATENCIES["latency_rack"], abs=2e-4)


def test_unnoticed_lags_spoil_the_relaxation_length():
    """Why lags are unknowns at all: without them sigma_f is off by more than a quarter, with them within 5 %."""
    cars, campaign = made.noisy()
    ours = identify(campaign, Options(("shared",))).modes["shared"][0]
    blind = identify(campaign, Options(("shared",), delays=False)).modes["shared"][0]
    truth = cars[0].sigma_f
    assert abs(ours.values["sigma_f"] / truth - 1.0) < 0.05
    assert abs(blind.values["sigma_f"] / truth - 1.0) > 0.25


def test_missing_channels_are_named_and_nothing_is_invented():
    """Without sideslip the axles cannot be balanced; without rack force there is no trail."""
    _, campaign = made.linear()
    no_slip = made.without(campaign, "sideslip_angle_rad", "lateral_speed_mps")
    data = measured(no_slip)[1].vehicle
    assert not can_balance(data.spectra)
    found = VehicleIdentification(campaign.vehicle, lags=False).fit([data])
    assert {"I-a1", "I-c"} <= set(found.skipped_)
    assert np.isfinite(found.params_["C_f"])
    bare = VehicleIdentification(campaign.vehicle).fit([measured(made.without(campaign, "rack_force_N"))[1].vehicle])
    assert "n_t" not in bare.params_
    assert "rack_force_N" in bare.skipped_["I-b1"]


def test_yaw_inertia_stays_within_its_theoretical_range():
    """A theory that is 20 % off ends at the bound and carries no standard error."""
    _, campaign = made.linear()
    vehicle = campaign.vehicle._replace(yaw_inertia=1.2 * campaign.vehicle.yaw_inertia)
    found = VehicleIdentification(vehicle, lags=False).fit([measured(campaign)[1].vehicle])
    assert found.params_["J_z"] == pytest.approx(0.95 * vehicle.yaw_inertia, rel=1e-3)
    assert "J_z" not in found.std_
