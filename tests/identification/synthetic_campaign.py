"""A small valid campaign for tests of the reader, from a closed-form single-track car.

No line is shared with the project: the car is the textbook transfer function without relaxation,
driven by a sine whose frequency rises, and the torsion-bar torque is a static share of the rack
torque. Good enough to be plausible; not meant to be identified to a tolerance.
"""

from pathlib import Path

import numpy as np
from scipy import signal

MASS, L_F, L_R, J_Z, I_S, I_RP = 1640.0, 1.24, 1.46, 2800.0, 16.2, 118.0
C_F, C_R, TRAIL = 118e3, 146e3, 0.083
J_WHEEL, J_ROBOT, B_WHEEL, C_TB = 0.040, 0.030, 0.10, 115.0
RATE = 50.0

VEHICLE_TOML = f"""schema_version = 1
name = "synthetic single track"
kind = "vehicle"

[vehicle]
mass_kg = {MASS}
cg_to_front_axle_m = {L_F}
cg_to_rear_axle_m = {L_R}
yaw_inertia_kgm2 = {J_Z}
steering_ratio = {I_S}
pinion_ratio_rad_per_m = {I_RP}

[steering]
wheel_inertia_kgm2 = {J_WHEEL}
robot_inertia_kgm2 = {J_ROBOT}
wheel_damping_Nms_per_rad = {B_WHEEL}
torsion_bar_stiffness_Nm_per_rad = {C_TB}
torsion_bar_damping_Nms_per_rad = 0.3
"""


def vehicle_run(
    speed_kmh: float, seconds: float = 17.5, phase: float = 0.0
) -> dict[str, np.ndarray]:
    """Channels of one frequency-response run, contract names, SI."""
    v = speed_kmh / 3.6
    t = np.arange(round(seconds * RATE) + 1) / RATE
    pinion = 0.4 * np.sin(2 * np.pi * (0.2 * t + 0.5 * (4.8 / 17.5) * t * t) + phase)
    a = np.array(
        [
            [-(C_F + C_R) / (MASS * v), -v - (C_F * L_F - C_R * L_R) / (MASS * v)],
            [-(C_F * L_F - C_R * L_R) / (J_Z * v), -(C_F * L_F**2 + C_R * L_R**2) / (J_Z * v)],
        ]
    )
    b = np.array([[C_F / MASS], [C_F * L_F / J_Z]]) / I_S
    _, x, _ = signal.lsim((a, b, np.eye(2), np.zeros((2, 1))), pinion, t)
    lateral, yaw = x.T
    front = pinion / I_S - (lateral + L_F * yaw) / v
    rear = -(lateral - L_R * yaw) / v
    rack_torque = C_F * TRAIL * front / I_S
    bar = rack_torque / 3.4 + 0.05 * np.gradient(pinion, t)
    wheel = pinion + bar / C_TB
    rate = np.gradient(wheel, t)
    torque = bar + B_WHEEL * rate + (J_WHEEL + J_ROBOT) * np.gradient(rate, t)
    return {
        "time_s": t,
        "steering_angle_rad": wheel,
        "steering_torque_Nm": torque,
        "pinion_angle_rad": pinion,
        "torsion_bar_torque_Nm": bar,
        "rack_force_N": rack_torque * I_RP,
        "vehicle_speed_mps": v + 0.05 * np.sin(0.3 * t),
        "lateral_speed_mps": lateral,
        "yaw_rate_radps": yaw,
        "lateral_acceleration_mps2": (C_F * front + C_R * rear) / MASS,
        "sideslip_angle_rad": lateral / v,
    }


def write_csv(path: Path, channels: dict[str, np.ndarray]) -> None:
    """One header line, then the samples with nine digits."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack(list(channels.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(channels), comments="", fmt="%.9g")


def write_vehicle_campaign(folder: Path) -> Path:
    """Three repeats at 60 km/h and one run at 90 km/h; returns the folder."""
    entries = []
    for speed, repeat in ((60, 1), (60, 2), (60, 3), (90, 1)):
        file = f"runs/{speed:03d}_frequency_response_{repeat}.csv"
        write_csv(folder / file, vehicle_run(speed, phase=0.2 * repeat))
        entries.append(
            f'\n[[runs]]\nfile = "{file}"\nmanoeuvre = "frequency_response"\n'
            f'speed_kmh = {speed}.0\nrole = "auto"\n'
        )
    (folder / "campaign.toml").write_text(VEHICLE_TOML + "".join(entries), encoding="utf-8")
    return folder


def write_rig_campaign(folder: Path, change: dict[str, str | None] | None = None) -> Path:
    """A motor of 0.02 kg m2, 0.05 N m s/rad; ``change``: a channel dropped or held constant."""
    t = np.arange(0.0, 10.0, 0.002)
    angle = np.sin(2 * np.pi * (0.5 + 0.1 * t) * t)
    rate = np.gradient(angle, t)
    channels = {
        "time_s": t,
        "motor_angle_rad": angle,
        "motor_torque_Nm": 0.02 * np.gradient(rate, t) + 0.05 * rate,
    }
    for name, what in (change or {}).items():
        if what is None:
            del channels[name]
        else:
            channels[name] = np.full_like(t, 0.3)
    write_csv(folder / "runs/sweep.csv", channels)
    (folder / "campaign.toml").write_text(
        'schema_version = 1\nname = "rig"\nkind = "rig"\n\n[rig]\ninertia_kgm2 = 0.02\n\n'
        '[[runs]]\nfile = "runs/sweep.csv"\nmanoeuvre = "torque_sweep"\n',
        encoding="utf-8",
    )
    return folder
