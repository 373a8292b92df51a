"""Every manoeuvre: a bounded, smooth, repeatable function of time that starts at rest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from steer_env.manoeuvres import MANOEUVRES, kind_of
from steer_env.manoeuvres.release import HOLD_TIME
from steer_env.units import check_ranges


def sampled(name: str, p=None, dt: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    """Times [n] and hands [n, 4] from before the start to after the end."""
    row = MANOEUVRES[name]
    p = p or row.parameters
    t = np.arange(-0.2, p.lead_in + p.duration + 0.5, dt)
    return t, np.array([row.signal(float(s), p) for s in t])


@pytest.mark.parametrize("name", MANOEUVRES)
def test_manoeuvres_are_finite_bounded_and_start_at_rest(name):
    """Catches a signal that jumps at the lead-in, grows without bound or leaves its range."""
    p = MANOEUVRES[name].parameters
    check_ranges(p, name)
    t, hands = sampled(name)
    assert np.isfinite(hands).all()
    assert (hands[t <= p.lead_in, :3] == 0.0).all()
    assert np.abs(hands[:, 0]).max() <= abs(p.amplitude) * (1.0 + 1e-12)
    # Twelve tones may meet; their sum stays below sqrt(12 / 2) times the rms they are scaled to.
    assert np.abs(hands[:, 2]).max() <= 2.5 * abs(p.amplitude)
    assert ((hands[:, 3] == 1.0) | (hands[:, 3] == 0.0)).all()
    assert (name == "release") == bool((hands[:, 3] == 0.0).any())


@pytest.mark.parametrize("name", MANOEUVRES)
def test_rate_is_the_derivative_of_the_angle(name):
    """Catches a lost factor in the rate; a robot's damper would then drag on the wheel."""
    p = MANOEUVRES[name].parameters
    t, hands = sampled(name, dt=2e-4)
    slope = np.gradient(hands[:, 0], t)
    inside = (t > p.lead_in + 0.002) & (t < p.lead_in + p.duration - 0.002)
    corner = np.zeros_like(inside)
    if name == "constant_speed_cornering":
        corner = np.abs(t - p.lead_in - 0.9 * p.duration) < 1e-3
    if name == "release":
        inside &= t < p.lead_in + HOLD_TIME - 0.002
    use = inside & ~corner
    scale = max(np.abs(hands[:, 1]).max(), 1e-9)
    assert np.abs(slope - hands[:, 1])[use].max() < 2e-3 * scale


def test_the_chirp_runs_from_02_to_5_hz():
    """Instantaneous frequency at start, middle and end, from the zero crossings of the angle."""
    p = MANOEUVRES["frequency_response"].parameters
    t, hands = sampled("frequency_response", dt=1e-4)
    up = t[1:][(hands[:-1, 0] < 0.0) & (hands[1:, 0] >= 0.0)]
    frequency = 1.0 / np.diff(up)
    middle = 0.5 * (up[1:] + up[:-1]) - p.lead_in
    np.testing.assert_allclose(frequency, 0.2 + 4.8 * middle / 17.5, rtol=0.02)
    assert frequency[-1] > 4.8
    assert frequency[0] < 1.0


def test_the_sine_has_its_period_and_amplitude():
    """0.2 Hz, four periods."""
    _, hands = sampled("steady_state")
    p = MANOEUVRES["steady_state"].parameters
    assert hands[:, 0].max() == pytest.approx(p.amplitude, rel=1e-6)
    assert np.sum((hands[:-1, 0] < 0.0) & (hands[1:, 0] >= 0.0)) in (3, 4)


def test_a_phase_draws_another_random_torque_and_the_same_phase_the_same():
    """Catches randomness hidden in a manoeuvre: its phase is all there is."""
    p = MANOEUVRES["random_torque"].parameters
    _, one = sampled("random_torque", p._replace(phase=3.0))
    _, again = sampled("random_torque", p._replace(phase=3.0))
    _, other = sampled("random_torque", p._replace(phase=4.0))
    assert (one == again).all()
    assert abs(np.corrcoef(one[:, 2], other[:, 2])[0, 1]) < 0.5
    inside = one[2000:-1000, 2]
    assert np.std(inside) == pytest.approx(0.5 * p.amplitude, rel=0.25)
    spectrum = np.abs(np.fft.rfft(inside)) ** 2
    f = np.fft.rfftfreq(len(inside), 1e-3)
    assert spectrum[f < 4.2].sum() > 0.99 * spectrum.sum()


def test_release_lets_go_in_the_middle_of_a_held_corner():
    """ISO 17288-1: held, then grip 0 and no torque of the driver's own."""
    p = MANOEUVRES["release"].parameters
    t, hands = sampled("release")
    held = (t > p.lead_in + 1.5) & (t < p.lead_in + HOLD_TIME)
    assert hands[held, 0] == pytest.approx(p.amplitude)
    assert (hands[t > p.lead_in + HOLD_TIME + 1e-9] == 0.0).all()


@pytest.mark.parametrize("name", MANOEUVRES)
def test_amplitude_scales_the_whole_signal(name):
    """Linear and odd in the amplitude: what left-right symmetry of an episode rests on."""
    p = MANOEUVRES[name].parameters._replace(amplitude=0.7)
    _, one = sampled(name, p, dt=0.01)
    _, minus = sampled(name, p._replace(amplitude=-0.7), dt=0.01)
    assert (one[:, :3] == -minus[:, :3]).all()
    assert (one[:, 3] == minus[:, 3]).all()
    assert math.isclose(kind_of(name), list(MANOEUVRES).index(name))
