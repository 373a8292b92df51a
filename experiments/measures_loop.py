"""Indices of a hysteresis loop: what on-centre tests read off torque, angle and lateral acceleration.

A loop is whole periods of a slow sine. Names follow the on-centre literature (ISO 13674-1 and the index lists made
from it); each index is a pure function of a ``Loop``, checked against a closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from experiments.measures import JND, Array, centre_slope, crossings, half_width, line_slope, loop_area, ratio
from steer_env.units import to_deg

OFF_CENTRE_G = 0.1  # lateral acceleration at which torque and its gradient are read, besides 0 g
SHAPE_TORQUE = 5.0  # N m, range over which the shape of the assist is compared
SHAPE_POINTS = 101  # angles at which it is compared
SHAPE_SHARE = 0.95  # of the peak angle: beyond it the branches turn
ANSWER_G = (0.05, 0.15)  # lateral accelerations between which a car counts as answering in a straight line, assumption
# Difference thresholds of steering-wheel torque were measured at 1, 3 and 5 N m (SAE 2014-01-0447). Below 1 N m a share
# of the torque is no measure any more (friction near its detection threshold does not follow Weber's law), so there the
# threshold stays what it is at 1 N m.
FLOOR_TORQUE = 1.0


@dataclass(frozen=True)
class Loop:
    """Angle [n] in rad, torque [n] in N m, lateral acceleration [n] in g, over whole ``cycles``; 0: there is none."""

    angle: Array
    torque: Array
    acceleration: Array
    cycles: int

    @property
    def reach(self) -> tuple[float, float]:
        """Half the range of the angle in rad and of the acceleration in g."""
        return 0.5 * float(np.ptp(self.angle)), 0.5 * float(np.ptp(self.acceleration))


def stiffness(loop: Loop) -> float:
    """Slope of torque over angle on-centre in N m/deg."""
    return centre_slope(loop.angle, loop.torque) / to_deg(1.0)


def average_stiffness(loop: Loop) -> float:
    """Range of torque over range of angle in N m/deg."""
    return ratio(float(np.ptp(loop.torque)), to_deg(float(np.ptp(loop.angle))))


def gradient(loop: Loop, at: float) -> float:
    """Slope of torque over lateral acceleration in N m/g at +-``at`` g, mean of both sides and branches."""
    slopes = [centre_slope(loop.acceleration, loop.torque, place) for place in (at, -at)]
    return 0.5 * (slopes[0] + slopes[1])


def torque_at(loop: Loop, at: float) -> float:
    """Torque in N m at ``at`` g, free of friction: mean of the branches, half of right and left's difference."""
    right, left = (_mean_crossing(loop.acceleration - place, loop.torque) for place in (at, -at))
    return 0.5 * (right - left)


def _mean_crossing(x: Array, y: Array) -> float:
    up, down = crossings(x, y, True), crossings(x, y, False)
    return 0.5 * float(up.mean() + down.mean()) if up.size and down.size else float("nan")


class Index(NamedTuple):
    """A row of INDICES: unit, meaning, its function of a loop, and what ``FLOOR_TORQUE`` amounts to in its unit."""

    unit: str
    meaning: str
    measure: Callable[[Loop], float]
    floor: Callable[[Loop], float]


def _floor_over_angle(loop: Loop) -> float:
    return ratio(FLOOR_TORQUE, to_deg(loop.reach[0]))


def _floor_over_acceleration(loop: Loop) -> float:
    return ratio(FLOOR_TORQUE, loop.reach[1])


def _floor(loop: Loop) -> float:
    return FLOOR_TORQUE


INDICES: dict[str, Index] = {
    "torque_hysteresis": Index(
        "N m", "steering friction: half the width in torque at 0 deg",
        lambda x: half_width(x.angle, x.torque), _floor,
    ),
    "angle_hysteresis": Index(
        "deg", "half the width in angle at 0 N m",
        lambda x: to_deg(half_width(x.torque, x.angle)), lambda x: ratio(FLOOR_TORQUE, stiffness(x)),
    ),
    "on_centre_stiffness": Index("N m/deg", "slope of torque over angle at 0 deg", stiffness, _floor_over_angle),
    "average_stiffness": Index(
        "N m/deg", "range of torque over range of angle", average_stiffness, _floor_over_angle
    ),
    "torque_gradient_0g": Index(
        "N m/g", "slope of torque over lateral acceleration at 0 g",
        partial(gradient, at=0.0), _floor_over_acceleration,
    ),
    "torque_gradient_01g": Index(
        "N m/g", "the same at 0.1 g", partial(gradient, at=OFF_CENTRE_G), _floor_over_acceleration
    ),
    "torque_0g": Index(
        "N m", "half the width in torque at 0 g", lambda x: half_width(x.acceleration, x.torque), _floor
    ),
    "torque_01g": Index("N m", "torque at 0.1 g, mean of the branches", partial(torque_at, at=OFF_CENTRE_G), _floor),
    "returnability": Index(
        "g", "half the width in lateral acceleration at 0 N m",
        lambda x: half_width(x.torque, x.acceleration), lambda x: ratio(FLOOR_TORQUE, gradient(x, 0.0)),
    ),
    "loop_area": Index(
        "J", "energy kept per cycle",
        lambda x: loop_area(x.angle, x.torque, x.cycles), lambda x: 4.0 * FLOOR_TORQUE * x.reach[0],
    ),
}  # fmt: skip


def indices(loop: Loop) -> dict[str, float]:
    """Every index of a loop by name; NaN where there is no whole cycle, or none can be read."""
    return {name: row.measure(loop) if loop.cycles else float("nan") for name, row in INDICES.items()}


def feel_jnd(achieved: dict[str, float], wanted: dict[str, float], ideal: Loop) -> float:
    """Root mean square over the indices of their error in just noticeable differences of 15 %.

    Each error is divided by 15 % of the wanted index or of the floor, whichever is larger. The floor is what
    ``FLOOR_TORQUE`` amounts to in the unit of the index, by the ideal loop's own stiffness, gradient or range.
    Indices that cannot be read off both loops do not count.
    """
    if not ideal.cycles:
        return float("nan")
    shares = []
    for name, row in INDICES.items():
        scale = np.nanmax([abs(wanted[name]), row.floor(ideal), 0.0])
        shares.append(ratio(achieved[name] - wanted[name], JND * scale))
    known = np.array(shares)[np.isfinite(shares)]
    return float(np.sqrt(np.mean(known * known))) if known.size else float("nan")


def shape_error(achieved: Loop, ideal: Loop) -> float:
    """Rms difference in N m of torque over angle, each the mean of its branches and so free of friction.

    Over evenly spaced angles up to 95 % of the smaller range, where the ideal torque is within +-5 N m.
    """
    reach = SHAPE_SHARE * min(achieved.reach[0], ideal.reach[0]) if achieved.cycles and ideal.cycles else 0.0
    if reach <= 0.0:
        return float("nan")
    angles = np.linspace(-reach, reach, SHAPE_POINTS)
    wanted = _middle(ideal, angles)
    inside = np.abs(wanted) <= SHAPE_TORQUE
    error = (_middle(achieved, angles) - wanted)[inside]
    return float(np.sqrt(np.mean(error * error))) if error.size else float("nan")


def _middle(loop: Loop, angles: Array) -> Array:
    """Mean of the rising and the falling branch's torque [n] in N m at angles [n] in rad."""
    rising = np.gradient(loop.angle) > 0.0
    middle = np.zeros_like(angles)
    for branch in (rising, ~rising):
        if not branch.any():
            return np.full_like(angles, np.nan)
        order = np.argsort(loop.angle[branch])
        middle += 0.5 * np.interp(angles, loop.angle[branch][order], loop.torque[branch][order])
    return middle


def dead_band(control: Array, acceleration: Array) -> float:
    """How far a control [n] goes from the centre before the car answers, in the control's unit; ISO 13674-2.

    In a slow ramp to the left from straight ahead: the line through lateral acceleration [n] in g over the control,
    between 0.05 and 0.15 g, is extended back to 0 g. NaN where 0.15 g is not reached.
    """
    reached = np.flatnonzero(acceleration >= ANSWER_G[1])
    if not reached.size:
        return float("nan")
    answering = np.flatnonzero(acceleration[: reached[0]] > ANSWER_G[0])
    x, y = control[answering], acceleration[answering]
    slope = line_slope(x, y)
    return float(x.mean() - y.mean() / slope) if slope > 0.0 else float("nan")
