"""Hands at rest in the middle: what remains is the plant's and the controller's own unrest."""

from __future__ import annotations

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand

DEFAULT = ManoeuvreParameters(amplitude=0.0, duration=10.0)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: zero."""
    return Hand(0.0, 0.0, 0.0, 1.0)
