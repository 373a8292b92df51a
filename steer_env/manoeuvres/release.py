"""Free control (ISO 17288-1): hold a corner, then let go of the wheel."""

from __future__ import annotations

from steer_env.manoeuvres.parameters import ManoeuvreParameters
from steer_env.physics._jit import scalar
from steer_env.physics.driver import Hand

RISE_TIME = 1.0  # s to reach the held angle, assumption
HOLD_TIME = 3.0  # s from the start of the rise to the release, assumption
DEFAULT = ManoeuvreParameters(duration=8.0)


@scalar
def signal(t: float, p: ManoeuvreParameters) -> Hand:
    """Hand at t seconds: smooth rise to the amplitude, hold, then grip 0."""
    s = t - p.lead_in
    if s >= HOLD_TIME:
        return Hand(0.0, 0.0, 0.0, 0.0)
    u = min(max(s / RISE_TIME, 0.0), 1.0)
    return Hand(
        p.amplitude * u * u * (3.0 - 2.0 * u),
        p.amplitude * 6.0 * u * (1.0 - u) / RISE_TIME,
        0.0,
        1.0,
    )
