"""Free control: what the wheel and the car do after the driver lets go in a corner (ISO 17288-1)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from experiments.measures import Array
from steer_env.units import to_deg

SETTLED = 0.05  # share of the angle at the release within which the wheel counts as settled
END_S = 0.1  # s at the end whose mean is where the wheel comes to rest
THROWN = 10.0  # times the angle at the release: the wheel was thrown, nothing settles
LEAST_SWING = 0.02  # share of the yaw rate at the release; smaller swings are creep and noise


class FreeControl(NamedTuple):
    """Overshoot past straight ahead in % of the angle at the release, angle left in deg, settling time in s, damping.

    ``damping`` is the damping ratio of the yaw rate; NaN where it does not swing.
    """

    overshoot: float
    residual: float
    settling: float
    damping: float


UNKNOWN = FreeControl(*[math.nan] * 4)


def free_control(angle: Array, yaw_rate: Array, release: int, dt: float) -> FreeControl:
    """Read the four numbers off steering angle [n] in rad and yaw rate [n] in rad/s; ``release``: last sample held.

    Settling is to 5 % of the angle at the release, about where the wheel comes to rest. All NaN where the record ends
    too soon, where nothing was steered, and where the motion grows without bound.
    """
    end = round(END_S / dt)
    if angle.size < release + 2 * end or angle[release] == 0.0 or yaw_rate[release] == 0.0:
        return UNKNOWN
    share = angle[release:] / angle[release]
    if not np.abs(share).max() < THROWN:
        return UNKNOWN
    rest = float(share[-end:].mean())
    outside = np.flatnonzero(np.abs(share - rest) > SETTLED)
    return FreeControl(
        overshoot=100.0 * max(0.0, -float(share.min())),
        residual=to_deg(abs(rest * float(angle[release]))),
        settling=float(outside[-1] + 1) * dt if outside.size else 0.0,
        damping=damping_ratio(yaw_rate[release:] / yaw_rate[release]),
    )


def damping_ratio(motion: Array) -> float:
    """Damping ratio of a decaying swing [n] that starts at rest at 1, from the logarithmic decrement.

    Of the swings from one turning point to the next, so that it does not matter where the motion comes to rest. The
    start counts as a turning point: a corner is held steadily before it is let go.
    """
    swings = np.abs(np.diff(turning_points(motion, LEAST_SWING)))
    if swings.size < 2:
        return float("nan")
    decrement = math.log(swings[0] / swings[-1]) / (swings.size - 1)  # per half period
    return decrement / math.hypot(math.pi, decrement)


def turning_points(motion: Array, least: float) -> Array:
    """The start and the extremes after it [n] that lie at least ``least`` apart, up and down in turn."""
    slope = np.sign(np.diff(motion))
    extremes = motion[1:-1][slope[:-1] * slope[1:] < 0.0]
    points = [float(motion[0])]
    for value in extremes.tolist():
        step = value - points[-1]
        if len(points) > 1 and step * (points[-1] - points[-2]) > 0.0:
            points[-1] = value
        elif abs(step) >= least:
            points.append(value)
    return np.array(points)
