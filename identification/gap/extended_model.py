"""From a fitted vehicle model to a reference file: what environments load besides the effects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identification.gap.fit import Solution
from identification.steady_state import on_centre_stiffness
from steer_env.physics.assist import assist
from steer_env.plants.reference_file import ReferenceFile
from steer_env.plants.reference_row import KnownVehicle, ReferenceRow
from steer_env.units import from_kmh

SHARED = ("n_t", "sigma_f", "sigma_r", "C_f", "C_r", "J_z", "sigma_assist", "c_fric")
LINEAR_AT = 2.0  # N m of torsion-bar torque at which the linear gain is taken, as a sweep's describing function


def vehicle_reference(vehicle: KnownVehicle, solution: Solution, provenance: Mapping[str, object]) -> ReferenceFile:
    """The nominal part of a solution as a reference, one row per speed, standard errors beside the values."""
    values = solution.values
    errors = dict(zip(values, np.sqrt(np.diag(solution.covariance)), strict=True))
    log = {unknown.name: unknown.log for unknown in solution.unknowns}
    speeds = sorted(float(name.partition("@")[2]) for name in values if name.startswith("J_ref@"))
    rows, std = [], []
    for speed_kmh in speeds:
        if speed_kmh <= 0.0:
            continue
        here = {name: name for name in SHARED} | {n: f"{n}@{speed_kmh:g}" for n in ("J_ref", "b_ref", "M_fric_C")}
        r, sigma = min(values[f"r@{speed_kmh:g}"], 1.0), values["sigma_assist"]
        c_pin_on = on_centre_stiffness(values, from_kmh(speed_kmh), vehicle)
        rows.append(
            ReferenceRow(
                speed_kmh=speed_kmh,
                k_gain=float(assist(LINEAR_AT, r, sigma)) / LINEAR_AT - 1.0,
                c_pin_on=c_pin_on,
                c_pin_off=r * c_pin_on,
                **{name: values[source] for name, source in here.items()},
            )
        )
        std.append(
            {n: float(errors[s] * (values[s] if log[s] else 1.0)) for n, s in here.items()}
        )
    nothing: tuple[dict[str, float], ...] = tuple({} for _ in rows)
    measured: tuple[tuple[str, ...], ...] = tuple(() for _ in rows)
    return ReferenceFile(vehicle, tuple(rows), "relaxed", tuple(std), nothing, measured, dict(provenance))
