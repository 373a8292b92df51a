"""From the runs of one speed to what the steps work on: frequency responses, lags, and which channels there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identification.campaign import Campaign, Run
from identification.frf import (
    NEIGHBOURS,
    FrequencyResponse,
    Spectra,
    derivative,
    frequency_response,
    spectra,
)
from identification.vehicle import SpeedData
from steer_env.plants.reference_row import KnownVehicle

INSTRUMENT = "steering_torque_Nm"
ANGLE, TORQUE, RACK = "pinion_angle_rad", "torsion_bar_torque_Nm", "rack_force_N"
BODY_CHANNELS = {
    "yaw_rate": "yaw_rate_radps",
    "lateral_acceleration": "lateral_acceleration_mps2",
    "sideslip_angle": "sideslip_angle_rad",
}
FEWEST_POINTS = 6  # coherent points that a response needs to be of use: more than any step has unknowns


@dataclass(frozen=True)
class SpeedRuns:
    """The runs of one nominal speed in km/h, by use; ``speed`` is the mean measured one in m/s."""

    speed_kmh: float
    speed: float
    sweeps: list[Run]
    sines: list[Run]
    cornering: list[Run]
    held_out: list[Run]


@dataclass(frozen=True)
class SpeedResponses:
    """Responses of one speed: step I's in ``vehicle``, step II's by output; ``missing`` maps a response to why."""

    vehicle: SpeedData
    pinion: Mapping[str, FrequencyResponse]
    missing: dict[str, str]


class Measured(NamedTuple):
    """One speed's runs with the responses made from them."""

    runs: SpeedRuns
    responses: SpeedResponses


def runs_by_speed(campaign: Campaign) -> list[SpeedRuns]:
    """The campaign's runs by speed, ascending; speeds that were not driven in a manoeuvre have empty lists."""
    kinds = {k: campaign.select(k) for k in ("frequency_response", "steady_state", "constant_speed_cornering")}
    held = [campaign.select(k, "validate") for k in ("frequency_response", "steady_state")]
    found = []
    for speed_kmh in sorted({v for runs in kinds.values() for v in runs}):
        sweeps, sines, cornering = (kinds[k].get(speed_kmh, []) for k in kinds)
        speed = float(np.mean([measured_speed(run) for run in (*sweeps, *sines, *cornering)]))
        out = [run for runs in held for run in runs.get(speed_kmh, [])]
        found.append(SpeedRuns(speed_kmh, speed, sweeps, sines, cornering, out))
    return found


def measured_speed(run: Run) -> float:
    """Mean of the speed channel in m/s, the nominal speed where there is none."""
    channel = run.channels.get("vehicle_speed_mps")
    return run.speed if channel is None else float(np.mean(channel))


def responses(sweeps: Sequence[Run], speed: float, vehicle: KnownVehicle) -> SpeedResponses:
    """All responses of one speed in m/s; a sweep without steering torque or pinion angle has none."""
    common = [n for n in sweeps[0].channels if all(n in run.channels for run in sweeps)] if sweeps else []
    needed = [n for n in (INSTRUMENT, ANGLE) if n not in common]
    if needed:
        why = "no sweep at this speed" if not sweeps else f"no {' and '.join(needed)} channel"
        empty = Spectra(np.zeros(0), {})
        names = (*BODY_CHANNELS, "rack", "pinion")
        return SpeedResponses(SpeedData(speed, np.zeros((0, 3)), {}, empty), {}, dict.fromkeys(names, why))
    data = spectra(sweeps, common)
    angle = data.lines[ANGLE]
    missing: dict[str, str] = {}
    found: dict[str, FrequencyResponse] = {}
    for name, channel in BODY_CHANNELS.items():
        if channel in common:
            found[name] = frequency_response(data, INSTRUMENT, angle / vehicle.steering_ratio, channel, name)
        else:
            missing[name] = f"no {channel} channel"
    if RACK in common:
        found["rack"] = frequency_response(data, INSTRUMENT, angle / vehicle.pinion_ratio, RACK, "rack")
    else:
        missing["rack"] = f"no {RACK} channel"
    pinion = {}
    if TORQUE in common:
        for name, signal in (("pinion_angle", angle), ("pinion_rate", derivative(angle, data.frequency))):
            pinion[name] = frequency_response(data, INSTRUMENT, TORQUE, signal, name)
    else:
        missing["pinion"] = f"no {TORQUE} channel"
    _drop_incoherent(found, missing)
    _drop_incoherent(pinion, missing)
    n = data.frequency.size // NEIGHBOURS * NEIGHBOURS
    lines = data.frequency[:n].reshape(-1, NEIGHBOURS)
    return SpeedResponses(SpeedData(speed, lines, found, data), pinion, missing)


def _drop_incoherent(found: dict[str, FrequencyResponse], missing: dict[str, str]) -> None:
    for name in [n for n, response in found.items() if response.point.size < FEWEST_POINTS]:
        missing[name] = f"only {found[name].point.size} coherent points in {name}"
        del found[name]
