"""Chirp of the hand's angle, 0.2 to 5 Hz linear in 17.5 s (paper, section 2)."""

from __future__ import annotations

import math

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand
from steer_env.physics.elementary import sine_cosine

DEFAULT = ManoeuvreParameters()


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: amplitude x sin(2 pi (f0 s + (f1 - f0) s^2 / 2T)), s from the lead-in."""
    s = t - p.lead_in
    if s <= 0.0 or s >= p.duration:
        return Hand(0.0, 0.0, 0.0, 1.0)
    sweep = (p.frequency_end - p.frequency) / p.duration
    angle = 2.0 * math.pi * (p.frequency + 0.5 * sweep * s) * s
    omega = 2.0 * math.pi * (p.frequency + sweep * s)
    sine, cosine = sine_cosine(angle)
    return Hand(p.amplitude * sine, p.amplitude * omega * cosine, 0.0, 1.0)
