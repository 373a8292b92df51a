"""Metrics of the frequency response and of the impedance that is felt, against closed forms."""

import numpy as np
import pytest

from experiments import measures
from experiments.metrics import score
from tests.experiments.trials import answered, chirp, trial

FELT = ("pinion_angle", "torsion_bar_torque", "steering_torque")


def test_the_thresholds_fit_each_other():
    """15 % is 1.2 dB, and a phase whose complex error is 15 % is 8.6 deg."""
    assert pytest.approx(1.214, abs=5e-4) == measures.JND_DB
    assert pytest.approx(8.60, abs=5e-3) == measures.JND_DEG
    assert abs(np.exp(1j * np.radians(measures.JND_DEG)) - 1.0) == pytest.approx(0.15, rel=1e-12)


def driven(gain=1.0, delay=0.0, band=(0.2, 5.0), manoeuvre="frequency_response", **changes):
    """A linear trial whose angle is the reference's, scaled and late."""
    torque = chirp(band=band)
    return trial(
        manoeuvre, linear=True, pinion_angle=answered(torque, gain, delay),
        torsion_bar_torque=torque, steering_torque=torque, **changes,
    )  # fmt: skip


def test_one_threshold_of_gain_is_one():
    """Catches a JND of magnitude, complex error and headline that disagree on 15 %."""
    found = score(driven(gain=1.15))
    assert found["frf_magnitude_jnd"] == pytest.approx(1.0, rel=0.01)
    assert found["frf_phase_jnd"] == pytest.approx(0.0, abs=0.01)
    assert found["frf_complex"] == pytest.approx(0.15, rel=0.01)
    assert found["frf_jnd"] == pytest.approx(1.0, rel=0.01)
    assert found["frf_worst_jnd"] == pytest.approx(1.0, rel=0.02)


def test_a_delay_in_thresholds():
    """5 ms are 1.8 deg per Hz; mean over log f of 2 sin(pi f tau) / 0.15; the last point is the worst."""
    t = driven(delay=0.005)
    found, f = score(t), t.slow_response.frequency
    share = 2.0 * np.sin(np.pi * f * 0.005)
    assert found["frf_phase"] == pytest.approx(np.sqrt(np.sum((1.8 * f) ** 2 / f) / np.sum(1.0 / f)), rel=0.01)
    assert found["frf_jnd"] == pytest.approx(np.sum(share / f) / np.sum(1.0 / f) / 0.15, rel=0.01)
    assert found["frf_worst_jnd"] == pytest.approx(share.max() / 0.15, rel=0.02)


def test_beyond_5_hz_only_what_is_excited_counts():
    """Catches a score of noise: above a chirp's end torque over angle is the arm's, not the controller's."""
    slow = driven(gain=1.1)
    assert not slow.fast_response.frequency.size
    assert "frf_magnitude_fast" not in score(slow)
    fast = driven(gain=1.1, delay=0.001, band=(5.0, 30.0), manoeuvre="high_frequency_response")
    found, f = score(fast), fast.fast_response.frequency
    assert 5.0 <= f.min() < 5.3
    assert 29.7 < f.max() <= 30.0
    assert found["frf_magnitude_fast"] == pytest.approx(20.0 * np.log10(1.1), rel=0.02)
    assert found["frf_phase_fast"] == pytest.approx(0.36 * np.sqrt(np.sum(f) / np.sum(1.0 / f)), rel=0.02)
    assert not fast.slow_response.frequency.size, "nothing below 5 Hz was driven"
    torque = chirp()
    tones = trial("random_torque", linear=True, **dict.fromkeys(FELT, torque))
    assert 3.8 < tones.slow_response.frequency.max() <= 4.0, "its highest tone"


def test_what_is_incoherent_is_dropped():
    """A hand that does nothing leaves no point at all; a torque of its own leaves the few that chance lets pass."""
    idle = score(trial("frequency_response", pinion_angle=chirp(), torsion_bar_torque=chirp()))
    for name in ("frf_jnd", "frf_magnitude", "worst_phase", "transparency_error", "passivity_gap_impedance"):
        assert np.isnan(idle[name]), name
    rng = np.random.default_rng(0)
    foreign = trial(
        "frequency_response", linear=True, steering_torque=rng.normal(size=19000),
        torsion_bar_torque=rng.normal(size=19000), pinion_angle=rng.normal(size=19000),
    )  # fmt: skip
    response = foreign.response
    assert response.frequency.size <= 0.1 * response.all_frequency.size
    assert np.all(response.coherence**2 > 0.72)


def test_transparency_bandwidth_is_unbroken_from_below():
    """Catches a band that is counted beyond its first gap, and one that looks at attenuation only."""
    f = np.linspace(0.2, 5.0, 49)
    felt = np.where(f > 2.05, 1.3, 1.1) * np.exp(0.5j)
    felt[-1] = 1.0
    assert measures.transparency_bandwidth(f, felt) == pytest.approx(2.0)
    assert measures.transparency_bandwidth(f, 1.0 / felt) == pytest.approx(2.0)
    assert measures.transparency_bandwidth(f, np.full(49, 1.1 + 0j)) == pytest.approx(5.0)
    assert measures.transparency_bandwidth(f, np.full(49, 1.3 + 0j)) == 0.0
    assert np.isnan(measures.transparency_bandwidth(f[:0], felt[:0]))


def test_transparency_error_is_the_complex_logarithm():
    f = np.linspace(0.2, 5.0, 49)
    assert measures.transparency_error(f, np.full(49, np.exp(0.1 - 0.2j))) == pytest.approx(np.sqrt(0.05), rel=1e-12)
    late = np.exp(1j * f)  # |ln T| = f, whose mean over log f is (5 - 0.2) / ln(5 / 0.2)
    fine = np.linspace(0.2, 3.0, 20001)
    assert measures.transparency_error(fine, np.exp(1j * fine)) == pytest.approx(2.8 / np.log(15.0), rel=1e-3)
    assert measures.transparency_error(f, late) > 0.0
    found = score(driven(gain=1.15))
    assert found["transparency_error"] == pytest.approx(np.log(1.15), rel=0.01)
    assert score(driven(gain=1.1))["transparency_bandwidth"] > 4.8
    assert score(driven(gain=1.2))["transparency_bandwidth"] == 0.0


def test_passivity_gap_is_the_least_difference_of_real_parts_in_the_band():
    """Z = b + J s + k / s against one with other b, J and k: only b counts, and only where it is asked for."""
    f = np.linspace(0.1, 40.0, 400)
    s = 2j * np.pi * f
    wanted = 1.0 + 0.06 * s + 30.0 / s
    felt = 0.7 + 0.05 * s + 40.0 / s - np.where(f > 30.0, 5.0, 0.0)
    assert measures.passivity_gap(f, felt, wanted, (0.2, 30.0)) == pytest.approx(-0.3, rel=1e-12)
    assert measures.passivity_gap(f, felt, wanted, (0.2, 40.0)) == pytest.approx(-5.3, rel=1e-12)
    assert measures.passivity_gap(f, wanted, wanted, (0.2, 30.0)) == 0.0
    assert np.isnan(measures.passivity_gap(f, felt, wanted, (50.0, 60.0)))


def test_passivity_gap_of_a_trial_in_impedance():
    """Half the angle per torque is twice the impedance: the gap is the least of Re Z_ref."""
    t = driven(gain=0.5)
    f, _, wanted = t.slow_response
    expected = (1.0 / (2j * np.pi * f * wanted)).real.min()
    assert expected < -0.1, "the reference itself gives off energy at 75 km/h"
    assert score(t)["passivity_gap_impedance"] == pytest.approx(expected, abs=0.01)
