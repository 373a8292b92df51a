"""What the drive model is fitted to: filtered signals, the sliding samples, and its regressors.

Friction shows its level only while the wheel slides. At rest it holds any torque within +-M_C and
the angle says nothing of it; a fit over all samples would take such torque for a low level. So only
sliding samples are fitted; the resting ones serve as a check.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from identification.campaign import Run, require
from identification.channels import FloatArray
from steer_env.physics._jit import compiled
from steer_env.physics.friction import dahl_step

CHANNELS = ("steering_angle_rad", "steering_torque_Nm", "vehicle_speed_mps")


@dataclass(frozen=True)
class DriveSignals:
    """One run, filtered with zero phase: rad, rad/s, N m, m/s, each [n]; ``sliding`` [n] bool."""

    time: FloatArray
    angle: FloatArray
    rate: FloatArray
    torque: FloatArray
    speed: FloatArray
    sliding: np.ndarray


def prepare(run: Run, cutoff_Hz: float, sliding_rate: float) -> DriveSignals:
    """Filter a run: all channels alike, so that relations between them stay true.

    The low-pass makes a rate of a quantised angle (0.1 deg is common), and takes flicker of the
    last digit out, which the friction model would take for reversals.
    """
    require(run, CHANNELS, "the drive model")
    cutoff = min(cutoff_Hz, 0.4 / run.dt)
    low_pass = butter(2, cutoff, fs=1.0 / run.dt, output="sos")
    angle, torque, speed = (sosfiltfilt(low_pass, run.channels[name]) for name in CHANNELS)
    rate = np.gradient(angle, run.dt)
    return DriveSignals(
        run.time - run.time[0], angle, rate, torque, speed, np.abs(rate) > sliding_rate
    )


def hats(x: FloatArray, knots: FloatArray) -> FloatArray:
    """Piecewise-linear basis [n, k]: 1 at its knot, 0 at the others, constant beyond the ends."""
    return np.column_stack([np.interp(x, knots, row) for row in np.eye(len(knots))])


@compiled
def dahl_shape(angle: FloatArray, travel: float) -> FloatArray:
    """Dahl friction over M_C along an angle [n], -1 to 1; ``travel`` = M_C / c_fric in rad.

    Divided by M_C, Eq. 15 depends on the ratio M_C / c_fric alone: the level is linear in the fit.
    """
    shape = np.zeros(angle.size)
    for k in range(1, angle.size):
        shape[k] = dahl_step(shape[k - 1], angle[k] - angle[k - 1], 1.0, 1.0 / travel)
    return shape
