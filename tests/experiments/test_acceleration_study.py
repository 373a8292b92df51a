"""The acceleration study: noise against closed forms and the field's table, and what it calls best."""

import math

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from experiments import acceleration_study as study
from steer_env.envs.layout import PARAMETERS, PERIOD
from steer_env.envs.task import Task, prepare
from steer_env.plants import PLANTS, Reference

FINE = math.radians(0.009) / math.sqrt(12.0)  # rad rms of the rig's encoder


@pytest.mark.parametrize("bandwidth", study.BANDWIDTHS_HZ)
def test_the_plain_filters_noise_has_its_closed_form(bandwidth):
    """Catches a gain of the filter that is off, and torque that gets in where nothing but the angle may."""
    observer = study.plant_with(PLANTS["EPAS"], "plain", bandwidth).observer()
    angle, torque = study.noise_gains(observer)
    assert angle == pytest.approx(study.plain_gain(bandwidth), rel=1e-6)
    assert torque == 0.0


def test_the_noise_model_gives_the_published_table():
    """0.009 deg at 1 kHz, differenced twice: 111 rad/s2 unfiltered, and behind second-order Butterworth filters."""
    second_difference = np.zeros(4000)
    second_difference[:3] = np.array([1.0, -2.0, 1.0]) / PERIOD**2
    assert FINE * study.rms_gain(second_difference) == pytest.approx(111.0, rel=0.01)
    assert FINE * study.plain_gain(1e5) == pytest.approx(111.0, rel=0.01), "no filter left"
    assert 0.06 * FINE * study.plain_gain(1e5) == pytest.approx(6.6, rel=0.02), "N m of inertial torque"
    for cut_off, noise in ((100.0, 8.3), (50.0, 2.4), (30.0, 0.91), (20.0, 0.41), (10.0, 0.11)):
        filtered = lfilter(*butter(2, cut_off, fs=1.0 / PERIOD), second_difference)
        share = 0.07 if cut_off == 10.0 else 0.03  # two digits are given
        assert FINE * study.rms_gain(filtered) == pytest.approx(noise, rel=share), cut_off


@pytest.mark.parametrize("kind", study.KINDS)
@pytest.mark.parametrize("bandwidth", [20.0, 80.0])
def test_noise_is_measured_as_it_is_expected(kind, bandwidth):
    """On EPAS, whose angle noise makes rounding white: catches a noise that is left out of the sum."""
    plant = study.plant_with(PLANTS["EPAS"], kind, bandwidth)
    expected = study.expected_noise(plant.sensors, plant.observer())
    assert study.measured_noise(plant.sensors, plant.observer()) == pytest.approx(expected, rel=0.06)


def test_the_choice_reaches_the_control_unit_and_drawn_plants():
    """Catches an option of the plant that the rows never see."""
    plant = study.plant_with(PLANTS["SbW"], "plain", 25.0)
    for randomise in ((), ("plant",)):
        row = prepare(Task(plant, randomise=randomise), np.random.default_rng(0), PERIOD).row
        observer = PARAMETERS.read(row, "observer")
        assert (observer.known_inputs, observer.bandwidth_Hz) == (0.0, 25.0)
    assert PLANTS["SbW"].observer().known_inputs == 1.0


def test_the_best_is_the_closest_among_the_safe():
    """Catches a loop that tracks best because it is about to be thrown."""
    row = study.Result("EPAS", "pid", "known", 40.0, 0.05, 0.2, 0.1, -1.0, True)
    unsafe = row._replace(bandwidth_Hz=160.0, frf_complex=0.01, safe=False)
    thrown = row._replace(bandwidth_Hz=20.0, frf_complex=math.nan)
    worse = row._replace(kind="plain", frf_complex=0.06)
    assert study.best([unsafe, thrown, worse, row], "EPAS", "pid") == row
    assert study.best([unsafe, thrown], "EPAS", "pid") is None
    assert study.best([row], "SbW", "pid") is None


def test_one_loop_is_driven_and_judged():
    """A plain filter of 10 Hz lags too far for a steer-by-wire impedance; an observer of 40 Hz does not."""
    reference = Reference.load("published")
    slow = study.result("SbW", "pid", "plain", 10.0, reference)
    quick = study.result("SbW", "pid", "known", 40.0, reference)
    assert quick.safe
    assert not slow.safe
    assert slow.growth > 5.0 > 0.0 > quick.growth
    assert quick.frf_complex < 0.7 * slow.frf_complex
