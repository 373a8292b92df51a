"""The instrument method of Eq. 5: exact without noise, unbiased in a closed loop, honest about its scatter."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from identification import frf
from identification.speed_data import responses, runs_by_speed
from identification.vehicle import TrackModel
from tests.identification import independent_campaign as made


def first_speed(campaign):
    runs = runs_by_speed(campaign)[0]
    return runs, responses(runs.sweeps, runs.speed, campaign.vehicle)


def truth(car):
    names = ("C_f", "C_r", "sigma_f", "sigma_r", "J_z", "n_t")
    return {n: getattr(car, n) for n in names}


def test_noise_free_response_is_the_models_own():
    """Leakage, aliasing or a wrong average would show: H equals the single track's to 1e-5."""
    cars, campaign = made.linear()
    runs, measured = first_speed(campaign)
    model = TrackModel(runs.speed, measured.vehicle.lines, campaign.vehicle)
    for name in ("yaw_rate", "lateral_acceleration", "sideslip_angle"):
        response = measured.vehicle.responses[name]
        expected = response.average(model.body(name)(truth(cars[0]), response))
        assert np.abs(response.value / expected - 1.0).max() < 1e-5
    rack = measured.vehicle.responses["rack"]
    assert np.abs(rack.value / rack.average(model.rack(truth(cars[0]), rack)) - 1.0).max() < 1e-5


def test_direct_average_of_a_curved_response_would_not_do():
    """The same-average rule earns its place: at a resonance the plain model differs by more than 1e-3."""
    cars, campaign = made.linear()
    runs, measured = first_speed(campaign)
    response = measured.vehicle.responses["yaw_rate"]
    model = TrackModel(runs.speed, measured.vehicle.lines, campaign.vehicle)
    middle = model.body("yaw_rate")(truth(cars[0]), response)[:, 1]
    assert np.abs(response.value / middle - 1.0).max() > 1e-4


POLE, DT = np.exp(-0.01 / 0.3), 0.01  # a first-order plant of 0.3 s, sampled


def plant(frequency):
    return (1.0 - POLE) / (np.exp(2j * np.pi * frequency * DT) - POLE)


def closed_loop_records(rng, runs=40, n=2000):
    """The plant in a proportional loop, u = 3 (d - y - w): the noise w enters the loop and so the input."""
    t = np.arange(n) * DT
    d = signal.chirp(t, 0.2, 17.0, 5.0) * (t < 17.0)
    records = []
    for _ in range(runs):
        w = rng.normal(0.0, 0.5, n)
        y, u = np.zeros(n), np.zeros(n)
        for k in range(1, n):
            y[k] = POLE * y[k - 1] + (1.0 - POLE) * u[k - 1]
            u[k] = 3.0 * (d[k] - y[k] - w[k])
        records.append(SimpleNamespace(dt=DT, channels={"d": d, "u": u, "y": y + w}))
    return records


def test_instrument_has_no_closed_loop_bias_where_the_direct_ratio_has():
    """Y/U is pulled towards -1/C by the noise in the loop; S_dy/S_du is not."""
    records = closed_loop_records(np.random.default_rng(3))
    data = frf.spectra(records, ["d", "u", "y"])
    response = frf.frequency_response(data, "d", "u", "y", "plant")
    direct = (np.conj(data.lines["u"]) * data.lines["y"]).sum(0) / (np.abs(data.lines["u"]) ** 2).sum(0)
    band = data.frequency > 0.5
    direct_error = np.abs(direct[band] / plant(data.frequency[band]) - 1.0)
    ours = np.abs(response.value / plant(response.frequency) - 1.0)[response.frequency > 0.5]
    assert np.median(direct_error) > 3.0 * np.median(ours)
    within = np.abs(response.value - plant(response.frequency)) < 3.0 * response.standard_error
    assert within.mean() > 0.95


def test_coherence_limit_drops_points_without_signal():
    """Noise beyond the excitation must not be fitted: an output that is noise keeps no point."""
    rng = np.random.default_rng(0)
    t = np.arange(2000) * 0.01
    d = signal.chirp(t, 0.2, 17.5, 5.0) * (t < 17.5)
    runs = [SimpleNamespace(dt=0.01, channels={"d": d, "y": rng.normal(size=t.size)}) for _ in range(4)]
    response = frf.frequency_response(frf.spectra(runs, ["d", "y"]), "d", "d", "y", "noise")
    assert response.point.size == 0
    assert response.all_coherence.size > 25


def test_moving_record_is_tapered(monkeypatch):
    """A record cut in full motion throws its end step into every line; the taper keeps it out."""
    cars, campaign = made.linear()
    runs, _ = first_speed(campaign)
    cut = [SimpleNamespace(dt=r.dt, channels={k: v[:1740] for k, v in r.channels.items()}) for r in runs.sweeps]

    def error():
        measured = responses(cut, runs.speed, campaign.vehicle)
        response = measured.vehicle.responses["yaw_rate"]
        model = TrackModel(runs.speed, measured.vehicle.lines, campaign.vehicle)
        expected = response.average(model.body("yaw_rate")(truth(cars[0]), response))
        inner = (response.frequency > 0.4) & (response.frequency < 4.0)  # the taper itself takes the ends
        return np.median(np.abs(response.value / expected - 1.0)[inner])

    tapered = error()
    monkeypatch.setattr(frf, "MOTION", ())
    assert tapered < 0.005
    assert tapered < 0.5 * error()


@pytest.mark.parametrize("delay", [0.004, -0.007])
def test_lag_turns_the_phase_only(delay):
    """frf.delayed has the sign of a late signal: phase falls with frequency, magnitude stays."""
    lines = np.ones((1, 5), complex)
    frequency = np.linspace(0.2, 5.0, 5)
    late = frf.delayed(lines, frequency, delay)
    assert np.allclose(np.abs(late), 1.0)
    assert np.allclose(np.angle(late[0]), -2 * np.pi * frequency * delay)
