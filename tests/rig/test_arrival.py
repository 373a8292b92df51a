"""When a frame came does not depend on when it was read."""

import numpy as np
import pytest

from steer_env.rig.arrival import Arrival
from steer_env.rig.frame import Frame, Received

FRAME = Frame(0x211, bytes(8))


def times_of(came, offset, drift, delays):
    """Arrival times found for frames that came at times on the host's clock, stamped by another one, read late."""
    arrival = Arrival()
    stamps = offset + (1.0 + drift) * came
    return np.array([arrival.of(Received(FRAME, s, t + d)) for s, t, d in zip(stamps, came, delays, strict=True)])


@pytest.mark.parametrize("drift", [-1e-4, 0.0, 1e-4])
def test_late_reading_does_not_move_a_frame(drift):
    """Ten minutes at 100 Hz, one frame in ten read up to 20 ms late, the clocks 100 ppm apart."""
    rng = np.random.default_rng(1)
    came = 1e5 + 0.01 * np.arange(60_000)
    delays = 2e-5 + np.where(rng.random(came.size) < 0.1, 0.02 * rng.random(came.size), 0.0)
    found = times_of(came, 1.7e9, drift, delays)
    assert np.abs(found - came).max() < 1e-4
    assert np.all(found <= came + delays + 1e-6)


def test_a_clock_that_is_set_is_followed():
    came = 0.001 * np.arange(4000)
    arrival = Arrival()
    for k, t in enumerate(came):
        found = arrival.of(Received(FRAME, t + (3600.0 if k >= 2000 else 0.0), t + 1e-5))
        assert found == pytest.approx(t, abs=2e-5)
