"""The car alone on a sine of the pinion, and what the single track would see of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.physics._jit import compiled
from steer_env.physics.two_track import TwoTrackState, two_track_rates
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.testcar.car import drifted, mean_drift
from steer_env.testcar.kernel import PERIOD

VEHICLE_RECORD = (
    "lateral_speed",
    "yaw_rate",
    "lateral_acceleration",
    "roll",
    "rack_torque",
    "yaw_acceleration",
)
SETTLE = 6.0  # s before a harmonic is taken

Array = NDArray[np.floating]


@compiled
def vehicle_rollout(pinion_angle: Array, speed: float, p: TwoTrack) -> Array:
    """Record [n, len(VEHICLE_RECORD)] of the car alone, led by a pinion angle in rad [n] at PERIOD.

    The angle is taken as straight between samples; one Runge-Kutta step per period.
    """
    n = pinion_angle.size
    record = np.zeros((n, len(VEHICLE_RECORD)))
    x = TwoTrackState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    per_ratio = 1.0 / p.i_s
    for k in range(n):
        a0 = pinion_angle[k] * per_ratio
        a2 = pinion_angle[min(k + 1, n - 1)] * per_ratio
        a1 = 0.5 * (a0 + a2)
        k0, a_y, M_rack = two_track_rates(x, a0, speed, 0.0, p)
        record[k, 0], record[k, 1], record[k, 2] = x.lateral_speed, x.yaw_rate, a_y
        record[k, 3], record[k, 4], record[k, 5] = x.roll, M_rack, k0.yaw_rate
        k1, _, _ = two_track_rates(drifted(x, 0.5 * PERIOD, k0), a1, speed, 0.0, p)
        k2, _, _ = two_track_rates(drifted(x, 0.5 * PERIOD, k1), a1, speed, 0.0, p)
        k3, _, _ = two_track_rates(drifted(x, PERIOD, k2), a2, speed, 0.0, p)
        x = drifted(x, PERIOD, mean_drift(k0, k1, k2, k3))
    return record


class Harmonics(NamedTuple):
    """Complex amplitudes at one frequency; SI, slips and forces as the single track sees them."""

    pinion_angle: complex
    yaw_rate: complex
    lateral_acceleration: complex
    lateral_speed: complex
    rack_torque: complex
    front_force: complex
    rear_force: complex
    front_slip: complex
    rear_slip: complex


def harmonic(x: Array, t: Array, frequency_Hz: float) -> complex:
    """Complex amplitude of a sine of a frequency in Hz in ``x`` [n] over whole periods of ``t``."""
    return complex(2j * np.mean(x * np.exp(-2j * np.pi * frequency_Hz * t)))


def car_harmonics(speed: float, amplitude: float, frequency_Hz: float, p: TwoTrack) -> Harmonics:
    """Steady response of the car alone to a pinion sine in rad, at a speed in m/s."""
    periods = max(2, round(2.0 * frequency_Hz))
    window = round(periods / frequency_Hz / PERIOD)
    t = (np.arange(round(SETTLE / PERIOD) + window)) * PERIOD
    angle = amplitude * np.sin(2.0 * np.pi * frequency_Hz * t)
    record = vehicle_rollout(angle, speed, p)[-window:]
    time = t[-window:]
    column = {
        name: harmonic(record[:, k], time, frequency_Hz) for k, name in enumerate(VEHICLE_RECORD)
    }
    pinion = harmonic(angle[-window:], time, frequency_Hz)
    a_y, r, v_y = column["lateral_acceleration"], column["yaw_rate"], column["lateral_speed"]
    moment = p.J_z * column["yaw_acceleration"]
    per_length = 1.0 / (p.l_f + p.l_r)
    return Harmonics(
        pinion,
        r,
        a_y,
        v_y,
        column["rack_torque"],
        (p.l_r * p.m * a_y + moment) * per_length,
        (p.l_f * p.m * a_y - moment) * per_length,
        pinion / p.i_s - (v_y + p.l_f * r) / speed,
        (p.l_r * r - v_y) / speed,
    )
