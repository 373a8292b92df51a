"""A campaign on disk: one CSV file per run, and campaign.toml, which names them."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from steer_env import atomic
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun

SCHEMA_VERSION = 1
# The paper checks C_f and C_r with slow cornering that was not fitted; everything else the reader
# splits.
ROLES = {"constant_speed_cornering": "validate"}


def run_file(run: PlannedRun) -> str:
    """Path of a run inside the campaign."""
    return f"runs/{run.name}.csv"


def write_run(path: Path, columns: dict[str, NDArray[np.floating]]) -> None:
    """Write a run's columns, each [n], as CSV; the file appears whole or not at all."""
    text = io.StringIO()
    stamp = "%.2f" if columns["time_s"][1] - columns["time_s"][0] > 0.0099 else "%.4f"
    formats = [stamp if name == "time_s" else "%.7g" for name in columns]
    header = ",".join(columns)
    np.savetxt(
        text,
        np.column_stack(list(columns.values())),
        fmt=formats,
        delimiter=",",
        header=header,
        comments="",
    )
    atomic.write_text(path, text.getvalue())


def campaign_toml(name: str, car: VirtualCar, runs: list[PlannedRun]) -> str:
    """Text of campaign.toml.

    Yaw inertia is the car's design value; nothing else that is identified is given away.
    """
    vehicle, steering = car.vehicle, car.steering
    tables = {
        "vehicle": {
            "mass_kg": vehicle.m,
            "cg_to_front_axle_m": vehicle.l_f,
            "cg_to_rear_axle_m": vehicle.l_r,
            "yaw_inertia_kgm2": vehicle.J_z,
            "steering_ratio": vehicle.i_s,
            "pinion_ratio_rad_per_m": car.i_rp,
        },
        "steering": {
            "wheel_inertia_kgm2": steering.J_s,
            "robot_inertia_kgm2": car.robot.J,
            "wheel_damping_Nms_per_rad": steering.b_s,
            "torsion_bar_stiffness_Nm_per_rad": steering.c_tb,
            "torsion_bar_damping_Nms_per_rad": steering.b_tb,
        },
    }
    lines = [f"schema_version = {SCHEMA_VERSION}", f"name = {json.dumps(name)}", 'kind = "vehicle"']
    for table, values in tables.items():
        lines += ["", f"[{table}]", *(f"{key} = {value!r}" for key, value in values.items())]
    for run in runs:
        lines += [
            "",
            "[[runs]]",
            f'file = "{run_file(run)}"',
            f'manoeuvre = "{run.manoeuvre}"',
            f"speed_kmh = {run.speed_kmh!r}",
            f'role = "{ROLES.get(run.manoeuvre, "auto")}"',
        ]
    return "\n".join(lines) + "\n"
