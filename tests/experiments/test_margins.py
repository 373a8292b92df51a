"""Margins against loops whose margins can be written down."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from experiments.margins import DELAY_LIMIT, GAIN_LIMIT_dB, disk_gain, disk_phase_deg, margins

OMEGA = np.union1d(np.geomspace(1e-3, 3e3, 3000), [60.0])
S = 1j * OMEGA


@pytest.mark.parametrize(("gain", "delay"), [(20.0, 2e-3), (100.0, 1e-3), (400.0, 1e-3)])
def test_second_order_loop_behind_a_delay(gain, delay):
    """k e^(-s T) / (s (1 + s / 50)): by the textbook. Catches a delay counted from the wrong side."""
    corner = 50.0
    found = margins(gain * np.exp(-S * delay) / (S * (1.0 + S / corner)), OMEGA)
    cut = corner * math.sqrt(0.5 * (math.sqrt(1.0 + 4.0 * (gain / corner) ** 2) - 1.0))
    phase = 0.5 * math.pi - math.atan(cut / corner) - cut * delay
    turn = brentq(lambda w: 0.5 * math.pi - math.atan(w / corner) - w * delay, 1e-3, 2e3)
    size = gain / (turn * math.hypot(1.0, turn / corner))
    assert phase > 0.0
    assert found.phase_margin_deg == pytest.approx(math.degrees(phase), rel=1e-3)
    assert found.gain_margin_dB == pytest.approx(-20.0 * math.log10(size), abs=0.02)
    assert found.delay_margin_ms == pytest.approx(1e3 * min(phase / cut, DELAY_LIMIT), rel=1e-3)


@pytest.mark.parametrize("damping", [0.05, 0.4, 1.0])
def test_disk_margin_of_a_second_order_loop(damping):
    """w^2 / (s (s + 2 d w)): |S - T|^2 = 1 + 4 x^2 / ((1 - x^2)^2 + 4 d^2 x^2) peaks at x = 1."""
    w = 60.0
    found = margins(w * w / (S * (S + 2.0 * damping * w)), OMEGA)
    assert found.disk_margin == pytest.approx(2.0 * damping / math.sqrt(1.0 + damping**2), rel=1e-4)


def test_a_disk_margin_never_promises_more_than_gain_and_phase_alone():
    """The disk touches -1 last: its gain and phase are inside both single margins."""
    L = 300.0 * np.exp(-S * 2e-3) / (S * (1.0 + S / 200.0))
    found = margins(L, OMEGA)
    low, high = disk_gain(found.disk_margin)
    assert low * high == pytest.approx(1.0)
    assert 20.0 * math.log10(high) < found.gain_margin_dB
    assert disk_phase_deg(found.disk_margin) < found.phase_margin_deg
    for turned in (low, high, np.exp(1j * math.radians(disk_phase_deg(found.disk_margin)))):
        assert np.abs(1.0 + turned * L).min() > 1e-3


def test_an_integrator_has_all_margins_there_are():
    """S - T of k / s has size 1 everywhere: alpha 2, 90 deg, no gain that destabilises."""
    found = margins(30.0 / S, OMEGA)
    assert found.disk_margin == pytest.approx(2.0)
    assert found.phase_margin_deg == pytest.approx(90.0, rel=1e-6)
    assert found.gain_margin_dB == GAIN_LIMIT_dB
    assert found.delay_margin_ms == 1e3 * DELAY_LIMIT


def test_a_loop_that_needs_its_gain_has_a_margin_downwards():
    """k / (s - 1) is stable from k = 1 on: 6 dB down at k = 2. Catches a margin that only looks upwards."""
    assert margins(2.0 / (S - 1.0), OMEGA).gain_margin_dB == pytest.approx(6.02, abs=0.01)


def test_a_loop_without_crossover_is_free_of_phase_and_delay():
    found = margins(np.full(OMEGA.size, 0.5 + 0.0j), OMEGA)
    assert found.phase_margin_deg == 180.0
    assert found.delay_margin_ms == 1e3 * DELAY_LIMIT
    assert disk_gain(2.0) == (0.0, math.inf)
