"""Sine of the hand's angle at 0.2 Hz (paper, section 2): four periods; the first settles."""

from __future__ import annotations

import math

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand
from steer_env.physics.elementary import sine_cosine

DEFAULT = ManoeuvreParameters(duration=20.0)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: amplitude x sin(2 pi f s) with s the time since the lead-in."""
    s = t - p.lead_in
    if s <= 0.0 or s >= p.duration:
        return Hand(0.0, 0.0, 0.0, 1.0)
    omega = 2.0 * math.pi * p.frequency
    sine, cosine = sine_cosine(omega * s)
    return Hand(p.amplitude * sine, p.amplitude * omega * cosine, 0.0, 1.0)
