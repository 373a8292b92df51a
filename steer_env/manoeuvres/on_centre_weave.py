"""Weave about the straight: the 0.2 Hz sine at the small lateral acceleration of ISO 13674-1."""

from __future__ import annotations

from steer_env.manoeuvres.steady_state import DEFAULT, signal

__all__ = ["DEFAULT", "signal"]
