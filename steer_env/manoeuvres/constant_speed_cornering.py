"""Slow cornering at constant speed (paper, section 3.4.2): ramp to the amplitude, then hold."""

from __future__ import annotations

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand

HOLD_SHARE = 0.1  # share of the duration that the end angle is held, assumption
DEFAULT = ManoeuvreParameters(duration=20.0)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: straight ramp, then hold."""
    ramp = p.duration * (1.0 - HOLD_SHARE)
    s = t - p.lead_in
    if s <= 0.0:
        return Hand(0.0, 0.0, 0.0, 1.0)
    if s >= ramp:
        return Hand(p.amplitude, 0.0, 0.0, 1.0)
    return Hand(p.amplitude * s / ramp, p.amplitude / ramp, 0.0, 1.0)
