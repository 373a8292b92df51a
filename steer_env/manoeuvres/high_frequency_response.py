"""Small chirp of the hand's angle from 5 to 30 Hz: the band above what a driver steers, which he still feels.

Only a steering robot can drive it; feel ratings change with torque up to 30 Hz (arXiv 2403.17800).
"""

from __future__ import annotations

from steer_env.manoeuvres.frequency_response import signal
from steer_env.manoeuvres.parameters import ManoeuvreParameters

# 3 deg: beyond the friction's pre-sliding range at 5 Hz, within a robot's torque at 30 Hz; assumption.
DEFAULT = ManoeuvreParameters(amplitude=0.05, frequency=5.0, frequency_end=30.0)

__all__ = ["DEFAULT", "signal"]
