"""The data acquisition: what the sensors of the paper's Table 1 make of a run, at 100 Hz.

Every channel passes the same anti-alias filter (its delay is common, so it drops out of every
frequency response), is late by its source's latency, gets its own noise and is rounded to its own
resolution. Clean logs skip all four.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from steer_env.physics.effects import SensorError
from steer_env.testcar.kernel import PERIOD, RECORD
from steer_env.testcar.parameters import Disturbance

LOG_PERIOD = 0.01  # s, paper section 2
ANTI_ALIAS_HZ = 40.0
ANTI_ALIAS_ORDER = 4

Array = NDArray[np.floating]


class Channel(NamedTuple):
    """One logged signal: column, who measures it, noise rms and resolution, latency in s."""

    column: str
    source: str
    noise: float
    resolution: float
    latency: float


# Sources as in Table 1. Noise, resolution and latency are assumptions of the size that data sheets
# give: an IMU/GPS unit of the RT3000 class computes for 4 ms; the steering's CAN frame is 6 ms old
# when it is stamped, the speed frame 8 ms; robot and strain gauges are wired to the acquisition.
CHANNELS = (
    Channel("steering_angle_rad", "steering robot", 2e-5, 8.7e-5, 0.0),
    Channel("steering_torque_Nm", "steering robot", 0.05, 0.01, 0.0),
    Channel("pinion_angle_rad", "CAN, steering", 2e-4, 8.7e-4, 0.006),
    Channel("torsion_bar_torque_Nm", "CAN, steering", 0.01, 0.01, 0.006),
    Channel("rack_force_N", "strain gauges", 15.0, 2.0, 0.0),
    Channel("vehicle_speed_mps", "CAN, brakes", 0.02, 0.0156, 0.008),
    Channel("lateral_speed_mps", "IMU, GPS", 0.01, 0.001, 0.004),
    Channel("yaw_rate_radps", "IMU", 5e-4, 1.7e-4, 0.004),
    Channel("lateral_acceleration_mps2", "IMU", 0.02, 0.001, 0.004),
    Channel("sideslip_angle_rad", "IMU, GPS", 8e-4, 1.7e-4, 0.004),
)


# A bus that is late as a whole, and nothing else: what a blind test of the effects starts from.
COMMON_LATENESS = 0.004  # s
ALIKE_CHANNELS = tuple(c._replace(latency=COMMON_LATENESS if c.latency else 0.0) for c in CHANNELS)


def signals(record: Array, speed: float, i_rp: float) -> dict[str, Array]:
    """The logged quantities [n] at the kernel's period, undisturbed.

    ``i_rp`` in rad/m turns rack torque into rack force.
    """
    column = {name: record[:, k] for k, name in enumerate(RECORD)}
    return {
        "steering_angle_rad": column["steering_angle"],
        "steering_torque_Nm": column["steering_torque"],
        "pinion_angle_rad": column["pinion_angle"],
        "torsion_bar_torque_Nm": column["torsion_bar_torque"],
        "rack_force_N": i_rp * column["rack_torque"],
        "vehicle_speed_mps": np.full(len(record), speed),
        "lateral_speed_mps": column["lateral_speed"],
        "yaw_rate_radps": column["yaw_rate"],
        "lateral_acceleration_mps2": column["lateral_acceleration"],
        "sideslip_angle_rad": np.arctan2(column["lateral_speed"], speed),
    }


def log(
    record: Array,
    speed: float,
    i_rp: float,
    rng: np.random.Generator | None,
    channels: Sequence[Channel] = CHANNELS,
    errors: Sequence[tuple[SensorError, Any]] = (),
) -> dict[str, Array]:
    """Columns of a run's file: time_s and ``channels``, each [n_log]. ``rng`` None: a clean log.

    ``errors``: sensor effects of the catalogue with their parameters.
    """
    true = signals(record, speed, i_rp)
    for error, parameters in errors:
        _falsify(true, error, parameters)
    every = round(LOG_PERIOD / PERIOD)
    stamp = np.arange(0, len(record), every) * PERIOD
    columns: dict[str, Array] = {"time_s": stamp}
    if rng is None:
        return columns | {channel.column: true[channel.column][::every] for channel in channels}
    fine = np.arange(len(record)) * PERIOD
    b, a = butter(ANTI_ALIAS_ORDER, ANTI_ALIAS_HZ, fs=1.0 / PERIOD)
    for channel in channels:
        start = true[channel.column][0]
        filtered = start + lfilter(b, a, true[channel.column] - start)
        late = np.interp(stamp - channel.latency, fine, filtered)
        noisy = late + channel.noise * rng.standard_normal(len(stamp))
        columns[channel.column] = channel.resolution * np.round(noisy / channel.resolution)
    return columns


def _falsify(true: dict[str, Array], error: SensorError, parameters: Any) -> None:
    """Delay, scale and shift the channels that a sensor effect names, in place."""
    for name in error.channels:
        signal = true[name]
        if error.delay:
            fine = np.arange(len(signal)) * PERIOD
            signal = np.interp(fine - getattr(parameters, error.delay), fine, signal)
        if error.gain:
            signal = getattr(parameters, error.gain) * signal
        if error.offset:
            signal = signal + getattr(parameters, error.offset)
        true[name] = signal


def disturbances(n: int, p: Disturbance, rng: np.random.Generator | None) -> tuple[Array, Array]:
    """Return (road torque in N m at the pinion, side wind in N), [n] at the kernel's period.

    Zero without ``rng``.
    """
    if rng is None:
        return np.zeros(n), np.zeros(n)
    return _coloured(n, p.road_torque, p.road_Hz, rng), _coloured(n, p.side_force, p.side_Hz, rng)


def _coloured(n: int, rms: float, bandwidth_Hz: float, rng: np.random.Generator) -> Array:
    """First-order filtered white noise [n] of a given rms, in its steady state from the start."""
    keep = float(np.exp(-2.0 * np.pi * bandwidth_Hz * PERIOD))
    white = rng.standard_normal(n) * rms * np.sqrt(1.0 - keep * keep)
    filtered, _ = lfilter([1.0], [1.0, -keep], white, zi=[keep * rms * rng.standard_normal()])
    return np.asarray(filtered, dtype=np.float64)
