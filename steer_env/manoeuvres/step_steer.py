"""Step of the hand's angle with a smooth 0.15 s rise (ISO 7401 asks for 200 to 500 deg/s)."""

from __future__ import annotations

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand

RISE_TIME = 0.15  # s, assumption: about 200 deg/s at 20 deg
DEFAULT = ManoeuvreParameters(duration=5.0)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: amplitude x (3 u^2 - 2 u^3), u the share of the rise that has passed."""
    u = min(max((t - p.lead_in) / RISE_TIME, 0.0), 1.0)
    return Hand(
        p.amplitude * u * u * (3.0 - 2.0 * u),
        p.amplitude * 6.0 * u * (1.0 - u) / RISE_TIME,
        0.0,
        1.0,
    )
