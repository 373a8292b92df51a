"""What an effect may depend on in a motor on a bench, at one instant."""

from __future__ import annotations

from typing import NamedTuple


class RigMoment(NamedTuple):
    """Motor angle in rad and rate in rad/s."""

    angle: float
    rate: float
