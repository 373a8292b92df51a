"""A car that is exactly what is identified (Eqs. 4 and 6, torsion bar, wheel, robot), logged with noise and lags.

The virtual test vehicle is richer than the model, so its errors mix noise with model error. Here only noise is left,
which is what a standard error speaks of.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.campaign import Campaign, Run
from identification.campaign_toml import KnownSteering
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics._jit import compiled
from steer_env.physics.assist import assist
from steer_env.physics.friction import dahl_step
from steer_env.physics.reference import ReferenceParameters, reference_rates
from steer_env.physics.vehicle import SingleTrackState
from steer_env.plants.reference_row import KnownVehicle
from steer_env.testcar.plan import robot_target

Array = NDArray[np.float64]
STEP, LOG_EVERY = 5e-4, 20  # s; logs at 100 Hz
PINION_RATIO = 118.0  # rad/m
STEERING = KnownSteering(0.040, 0.030, 0.10, 115.0, 0.30)
COLUMNS = ("steering_angle_rad", "steering_torque_Nm", "pinion_angle_rad", "torsion_bar_torque_Nm", "rack_force_N",
           "lateral_speed_mps", "yaw_rate_radps", "lateral_acceleration_mps2")  # fmt: skip
# Noise (rms, column's unit) and latency (s): the virtual test vehicle's sensors, rounding included as noise.
NOISE = (3e-5, 0.05, 3.2e-4, 0.0104, 15.0, 0.01, 5e-4, 0.02)
LATENCY = (0.0, 0.0, 0.006, 0.006, 0.0, 0.004, 0.004, 0.004)


class Truth(NamedTuple):
    """One speed in m/s with its parameters and the sine's amplitude at the wheel in rad."""

    speed: float
    parameters: ReferenceParameters
    amplitude: float


@compiled
def rollout(target: Array, target_rate: Array, speed: float, p: ReferenceParameters) -> Array:
    """Record [n, len(COLUMNS)] at STEP for a wheel angle in rad and its rate that the robot is asked for."""
    record = np.zeros((target.size, 8))
    x, friction = np.zeros(8), 0.0
    weight, reach = (1.0, 2.0, 2.0, 1.0), (0.0, 0.5, 0.5, 1.0)
    for k in range(target.size):
        total, slope = np.zeros(8), np.zeros(8)
        for stage in range(4):
            z = x + reach[stage] * STEP * slope
            M_tb = 115.0 * (z[0] - z[2]) + 0.30 * (z[1] - z[3])
            M_s = 420.0 * (target[k] - z[0]) + 8.0 * (target_rate[k] - z[1])
            resist = dahl_step(friction, z[2] - x[2], p.M_fric_C, p.c_fric)
            track = SingleTrackState(z[4], z[5], z[6], z[7])
            push, body = reference_rates(z[2], z[3], track, assist(M_tb, p.r, p.sigma), resist, speed, p)
            if stage == 0:
                front, rear = p.C_f * z[6], p.C_r * z[7]
                record[k, 0], record[k, 1], record[k, 2], record[k, 3] = z[0], M_s, z[2], M_tb
                record[k, 4] = PINION_RATIO * front * p.n_t / p.i_s
                record[k, 5], record[k, 6], record[k, 7] = z[4], z[5], (front + rear) / p.m
            slope = np.array([z[1], (M_s - M_tb - 0.10 * z[1]) / 0.070, z[3], push,
                              body.lateral_speed, body.yaw_rate, body.slip_front, body.slip_rear])  # fmt: skip
            total += weight[stage] * slope
        step = STEP / 6.0 * total
        friction = dahl_step(friction, step[2], p.M_fric_C, p.c_fric)
        x = x + step
    return record


def clean_runs(truth: Truth, repeats: int = 2) -> list[tuple[str, Array]]:
    """(manoeuvre, record at 1 ms) of ``repeats`` sweeps and sines."""
    sweep = min(truth.amplitude, 0.6)
    made = []
    for manoeuvre, amplitude in (("frequency_response", sweep), ("steady_state", truth.amplitude)):
        for k in range(repeats):
            coarse, _ = robot_target(manoeuvre, amplitude * (1.0 + 0.02 * k))
            fine = np.arange(2 * coarse.size - 1) * STEP
            spline = CubicSpline(np.arange(coarse.size) * 2 * STEP, coarse)
            made.append((manoeuvre, rollout(spline(fine), spline(fine, 1), truth.speed, truth.parameters)[::2]))
    return made


def campaign(cars: list[tuple[Truth, list[tuple[str, Array]]]], rng: np.random.Generator) -> Campaign:
    """Noisy, late 100 Hz logs of clean runs as a campaign; all runs are for identification."""
    runs = []
    for truth, clean in cars:
        for number, (manoeuvre, record) in enumerate(clean):
            time = np.arange(record.shape[0]) * 2 * STEP
            stamp: Array = time[:: LOG_EVERY // 2].astype(np.float64)
            channels = {"vehicle_speed_mps": np.full(stamp.size, truth.speed)}
            for k, name in enumerate(COLUMNS):
                late = np.interp(stamp - LATENCY[k], time, record[:, k])
                channels[name] = late + rng.normal(0.0, NOISE[k], stamp.size)
            sideslip = np.interp(stamp - LATENCY[5], time, record[:, 5]) / truth.speed
            channels["sideslip_angle_rad"] = sideslip + rng.normal(0.0, 8e-4, stamp.size)
            runs.append(Run(f"{manoeuvre}_{number}", manoeuvre, truth.speed, "identify", stamp, 0.01, channels))
    p = cars[0][0].parameters
    vehicle = KnownVehicle(p.m, p.l_f, p.l_r, p.J_z, p.i_s, PINION_RATIO)
    return Campaign("conforming car", "vehicle", vehicle, STEERING, None, runs, {}, Path("memory"))


assert set(MANOEUVRES) >= {"frequency_response", "steady_state"}
