"""Random human torque: twelve tones with scattered phases, a closed form of time."""

from __future__ import annotations

import math

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand
from steer_env.physics.elementary import sine_cosine

TONES = 12
GOLDEN_ANGLE = 2.399963229728653  # rad; multiples of it never line up
DEFAULT = ManoeuvreParameters(amplitude=2.5, frequency=0.15, frequency_end=4.0, duration=17.5)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Driver torque at t seconds in N m, rms amplitude / 2; log-spaced, falling as 1/sqrt(f)."""
    s = t - p.lead_in
    if s <= 0.0 or s >= p.duration:
        return Hand(0.0, 0.0, 0.0, 1.0)
    ratio = (p.frequency_end / p.frequency) ** (1.0 / (TONES - 1))
    fading = 1.0 / math.sqrt(ratio)
    f, share = p.frequency, 1.0
    torque = 0.0
    weight = 0.0
    for k in range(TONES):
        sine, _ = sine_cosine(2.0 * math.pi * f * s + p.phase * (k + 1.0) + GOLDEN_ANGLE * k * k)
        torque += share * sine
        weight += share * share
        f *= ratio
        share *= fading
    ease = min(s / 0.5, 1.0)
    return Hand(0.0, 0.0, p.amplitude * ease * torque / math.sqrt(2.0 * weight), 1.0)
