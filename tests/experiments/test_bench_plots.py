"""What a scored case keeps of its signals."""

import numpy as np
import pytest

from experiments.bench_plots import envelope


@pytest.mark.parametrize("n", [1, 50, 6000, 6013])
def test_an_envelope_loses_no_peak_and_invents_no_slow_wave(n):
    """Catches every n-th sample: of 100 Hz at a point in 10 ms that is a straight line, of one spike nothing."""
    time = 1e-3 * np.arange(n)
    fast = np.sin(2.0 * np.pi * 100.0 * time)
    spike = np.zeros(n)
    spike[n // 2] = -3.0
    found, (ramp, seen, peak) = envelope(time, time, fast, spike)
    assert len(found) == len(ramp) == len(seen) <= 120
    assert peak.min() == -3.0
    assert (seen.min(), seen.max()) == (fast.min(), fast.max())
    if n > 5000:  # spans of whole cycles: both ends of the wave stand in each
        assert np.ptp(seen.reshape(-1, 2)[:-1], axis=1).min() > 1.8
    step = -(-n // 60)
    assert np.abs(ramp - found)[: 2 * (n // step)].max(initial=0.0) <= max(0.25 * step, 0.5) * 1e-3
    assert np.allclose(np.diff(found), np.diff(found)[:1])
