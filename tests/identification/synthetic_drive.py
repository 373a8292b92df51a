"""A drive with known parameters, from an independent simulation: nothing of ours imported.

The wheel is held, turned and held again as a person does; Dahl's differential equation is
integrated in small steps; the bias is a random walk; the noise is coloured; the sensors round.
"""

from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

DAMPING, LEVEL, PRESLIDING = 0.5, 0.40, 160.0  # N m s/rad, N m, N m/rad
STEP = 1e-3


def stiffness(speed: np.ndarray | float) -> np.ndarray | float:
    """True stiffness in N m/rad at a speed in m/s: linear, so that any knots can hold it."""
    return 2.0 + 0.3 * np.asarray(speed)


def drive(
    seed: int, seconds: float = 200.0, level: float = LEVEL, noise: float = 0.08
) -> dict[str, np.ndarray]:
    """Channels of one drive at 50 Hz."""
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP)
    t = np.arange(n) * STEP
    angle = _hold_and_turn(rng, n)
    speed = 15.0 + 10.0 * np.sin(2 * np.pi * t / seconds * 1.5 + rng.uniform(0, 6))
    rate = np.gradient(angle, STEP)
    bias = _low_pass(np.cumsum(rng.normal(size=n)) * 0.12 * np.sqrt(STEP), 0.1)
    torque = stiffness(speed) * angle + DAMPING * rate + _dahl(angle, level) + bias
    white = _low_pass(rng.normal(size=n), 1.0)  # residuals that last half a second
    torque += noise * white / np.std(white)
    log = slice(None, None, 20)
    return {
        "time_s": t[log],
        "steering_angle_rad": _rounded(angle[log], np.radians(0.1)),
        "steering_torque_Nm": _rounded(torque[log], 0.0625),
        "vehicle_speed_mps": speed[log],
    }


def write_drive_campaign(folder: Path, channels: dict[str, np.ndarray]) -> Path:
    """Write the drive as a campaign; returns the folder."""
    (folder / "runs").mkdir(parents=True)
    table = np.column_stack(list(channels.values()))
    np.savetxt(
        folder / "runs/drive.csv", table, delimiter=",", header=",".join(channels), comments=""
    )
    (folder / "campaign.toml").write_text(
        'schema_version = 1\nname = "synthetic drive"\nkind = "drive"\n\n'
        '[[runs]]\nfile = "runs/drive.csv"\nmanoeuvre = "free"\n',
        encoding="utf-8",
    )
    return folder


def _hold_and_turn(rng: np.random.Generator, n: int) -> np.ndarray:
    """Targets held for 0.5 to 3 s, reached smoothly; a hand never holds a wheel quite still."""
    targets, k = np.zeros(n), 0
    while k < n:
        hold = round(rng.uniform(0.5, 3.0) / STEP)
        targets[k : k + hold] = rng.normal(scale=0.08)
        k += hold
    tremor = _low_pass(rng.normal(size=n), 2.0)
    return _low_pass(targets, 0.8) + 4e-4 * tremor / np.std(tremor)


def _dahl(angle: np.ndarray, level: float) -> np.ndarray:
    """dM/dx = c (1 - sign(dx) M / M_C), explicit: the steps are below 0.3 % of M_C / c."""
    torque = np.zeros(len(angle))
    steps = np.diff(angle)
    value = 0.0
    for k, dx in enumerate(steps):
        if level > 0.0:
            value += PRESLIDING * (dx - abs(dx) * value / level)
        torque[k + 1] = value
    return torque


def _low_pass(x: np.ndarray, frequency: float) -> np.ndarray:
    return sosfiltfilt(butter(2, frequency, fs=1 / STEP, output="sos"), x)


def _rounded(x: np.ndarray, unit: float) -> np.ndarray:
    return np.round(x / unit) * unit
