"""Metrics of what a driver feels in slow steering and after letting go: on-centre indices, dead band, free control."""

from __future__ import annotations

from functools import partial

import numpy as np

from experiments.measures import low_passed
from experiments.measures_free import FreeControl
from experiments.measures_loop import INDICES, dead_band, feel_jnd, shape_error
from experiments.metrics_row import RAMP, RELEASE, SINES, Metric, pair
from experiments.metrics_trial import LOOP_HZ, Trial
from steer_env.envs.layout import PERIOD
from steer_env.units import GRAVITY


def _index(name: str, t: Trial, of_ideal: bool) -> float:
    return (t.ideal_indices if of_ideal else t.achieved_indices)[name]


def _dead_band(of_torque: bool, t: Trial, of_ideal: bool) -> float:
    angle, torque = t.ideal if of_ideal else t.achieved
    acceleration = t.ideal_acceleration if of_ideal else t.episode["lateral_acceleration"]
    wheel = np.degrees(angle + torque / t.episode.part("steering").c_tb)
    return dead_band(low_passed(torque if of_torque else wheel, LOOP_HZ, PERIOD), acceleration / GRAVITY)


def _free(field: str, t: Trial, of_ideal: bool) -> float:
    found: FreeControl = t.ideal_free if of_ideal else t.free
    return float(getattr(found, field))


FEEL_ROWS: dict[str, Metric] = {
    "feel_jnd": Metric(
        "JND", "rms error of the ten loop indices below, each over 15 % of the reference's", SINES,
        lambda t: feel_jnd(t.achieved_indices, t.ideal_indices, t.ideal_loop),
    ),
    "assist_shape_error": Metric(
        "N m", "rms of torque over angle minus the reference's, without friction, within 5 N m", SINES,
        lambda t: shape_error(t.achieved_loop, t.ideal_loop),
    ),
}  # fmt: skip
for _name, _row in INDICES.items():
    FEEL_ROWS |= pair(_name, _row.unit, _row.meaning, SINES, partial(_index, _name))
for _name, _unit, _what, _of_torque in (
    ("torque_dead_band", "N m", "torque", True),
    ("angle_dead_band", "deg", "wheel angle", False),
):
    _meaning = f"{_what} from the centre before the car answers, slow ramp"
    FEEL_ROWS |= pair(_name, _unit, _meaning, RAMP, partial(_dead_band, _of_torque))
for _name, _unit, _meaning, _field in (
    ("overshoot", "%", "past straight ahead, of the angle at the release", "overshoot"),
    ("residual_angle", "deg", "where the wheel comes to rest", "residual"),
    ("settling_time", "s", "to 5 % of the angle at the release", "settling"),
    ("yaw_damping", "-", "damping ratio of the yaw rate, logarithmic decrement", "damping"),
):
    FEEL_ROWS |= pair(_name, _unit, _meaning, RELEASE, partial(_free, _field))
