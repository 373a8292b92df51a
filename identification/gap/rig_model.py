"""A rig campaign as the gap workflow sees it: the torque that a measured motion needs, against the commanded torque.

A simulation led by the torque would drift, as the angle is its double integral. The other way round everything is
measured: J q'' + b q' plus what the effects resist must be what was commanded (less what a torque sensor took).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identification.campaign import Campaign, Run, require
from identification.frf import Floats
from identification.gap.model import Present, Record, Unknown, Values
from identification.gap.repeats import records_of
from identification.gap.vehicle_model import late
from identification.motion import band_limited
from steer_env.errors import InputError
from steer_env.physics._jit import compiled
from steer_env.physics.bench import engaged_share, friction_after, resisting_torque, wheel_after
from steer_env.physics.effects import EFFECTS, Effect
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.effects.rig_ports import RIG_MECHANICAL, rig_row

ANGLE, TORQUE, SENSOR = "motor_angle_rad", "motor_torque_Nm", "sensor_torque_Nm"
BAND_HZ = 20.0  # torques are judged up to here
REST_RATE = 0.03  # rad/s below which the motor counts as at rest: three encoder steps of 0.009 deg in 16 ms
MOTION_HZ = 30.0  # of the motion, whose second derivative enters; both torques pass the same band limit


@compiled
def resisted(angle: Floats, rate: Floats, acceleration: Floats, J: float, b: float, row: Any) -> Floats:
    """Torque in N m [n] that a motion in rad, rad/s, rad/s2 [n] needs."""
    out = np.zeros(angle.size)
    friction, wheel = 0.0, angle[0]
    for k in range(angle.size):
        travel = angle[k] - angle[k - 1] if k > 0 else 0.0
        x = RigMoment(angle[k], rate[k])
        friction = friction_after(friction, travel, x, row)
        before, wheel = wheel, wheel_after(wheel, angle[k], row)
        share = engaged_share(wheel - before, travel)
        out[k] = share * (J * acceleration[k] + b * rate[k]) + resisting_torque(x, friction, row)
    return out


@dataclass
class RigModel:
    """J q'' + b q' = motor torque - sensor torque, for one campaign (``model.Model``)."""

    records: tuple[Record, ...]
    unknowns: tuple[Unknown, ...]
    effects: Mapping[str, Effect]
    channels: tuple[str, ...] = (TORQUE,)
    band_Hz: float = BAND_HZ
    _motions: dict[str, tuple[Floats, Floats, Floats]] = field(default_factory=dict, repr=False)

    def simulate(self, record: Record, values: Values, present: Present) -> dict[str, Floats]:
        """The torque [n] that should have been commanded; see ``model.Model``."""
        angle, rate, acceleration = self._motion(record)
        row = rig_row(present) if any(name in RIG_MECHANICAL for name in present) else None
        torque = resisted(angle, rate, acceleration, values["J"], values["b"], row)
        if SENSOR in record.inputs:
            torque = torque + record.inputs[SENSOR]
        torque = torque - present.get("torque_offset", {}).get("Nm", 0.0)
        torque = torque / present.get("torque_gain", {}).get("ratio", 1.0)
        # A command is held until the next one, so it acts half a sample late by nature.
        delay = 0.5 * record.dt + present.get("command_latency", {}).get("delay_s", 0.0)
        early = late(torque, -delay / record.dt)
        return {TORQUE: sliding(rate) * band_limited(early, record.dt, MOTION_HZ).signal()}

    def judged(self, outputs: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The torque itself."""
        return outputs

    def states(self, record: Record) -> dict[str, Floats]:
        """Angle, rate and acceleration [n]."""
        angle, rate, acceleration = self._motion(record)
        return {"motor angle": angle, "motor rate": rate, "motor acceleration": acceleration}

    def _motion(self, record: Record) -> tuple[Floats, Floats, Floats]:
        key = f"{record.name} {record.role}"
        if key not in self._motions:
            self._motions[key] = motion(record.inputs[ANGLE], record.dt)
        return self._motions[key]


def motion(angle: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """Angle, rate and acceleration [n] of a measured angle in rad, band-limited without phase."""
    limited = band_limited(angle, dt, MOTION_HZ)
    rate = limited.rate()
    return limited.signal(), rate.signal(), rate.rate().signal()


def sliding(rate: Floats) -> Floats:
    """Weight [n] from 0 at rest to 1 in motion: what friction holds while nothing moves no motion can tell."""
    weight: Floats = np.clip(np.abs(rate) / REST_RATE - 1.0, 0.0, 1.0)
    return weight


def rig_model(campaign: Campaign) -> RigModel:
    """Records and unknowns of a rig campaign; an ``InputError`` where angle or torque lacks."""
    if campaign.kind != "rig":
        raise InputError(f"{campaign.folder}: kind", f"'{campaign.kind}' is not 'rig'", "give a rig campaign")
    for run in campaign.runs:
        require(run, [ANGLE, TORQUE], "the gap workflow")
    inputs = (ANGLE, SENSOR)
    records = records_of(campaign.runs, ANGLE, inputs, (TORQUE,))
    J, b = start_values(campaign.runs)
    unknowns = (
        Unknown("J", J, 0.2 * J, 5.0 * J, 0.5),
        Unknown("b", b, -5.0, 20.0, 0.2, log=False),
    )
    with_sensor = any(SENSOR in record.inputs for record in records)
    effects = {
        name: effect for name, effect in EFFECTS["rig"].items() if with_sensor or SENSOR not in effect.needs
    }
    return RigModel(tuple(_with_noise(record, campaign.runs, J, b) for record in records), unknowns, effects)


def start_values(runs: list[Run]) -> tuple[float, float]:
    """Least-squares J in kg m2 and b in N m s/rad over the fitted runs."""
    table, torque = [], []
    for run in runs:
        if run.role == "identify":
            _, rate, acceleration = motion(run.channels[ANGLE], run.dt)
            table.append(np.column_stack([acceleration, rate]))
            torque.append(run.channels[TORQUE] - run.channels.get(SENSOR, np.zeros_like(rate)))
    (J, b), *_ = np.linalg.lstsq(np.concatenate(table), np.concatenate(torque), rcond=None)
    return max(float(J), 1e-5), float(b)


def _with_noise(record: Record, runs: list[Run], J: float, b: float) -> Record:
    """The record with its torque band-limited, and repeats that hold the noise where it is: in the motion.

    Repeats of one command are equal to the bit; what differs is the motion that they cause and how it is measured.
    """
    first = record.name.partition(" and ")[0].partition(",")[0]
    lead = next(run for run in runs if run.name == first)
    family = [
        run for run in runs
        if (run.role, run.manoeuvre, run.speed_kmh) == (lead.role, lead.manoeuvre, lead.speed_kmh)
        and abs(float(np.std(run.channels[ANGLE][: record.inputs[ANGLE].size] - record.inputs[ANGLE])))
        < 0.05 * float(np.std(record.inputs[ANGLE]))
    ][: max(len(record.repeats), 1)]  # fmt: skip
    n = record.inputs[ANGLE].size
    repeats = []
    for run in family:
        _, rate, acceleration = motion(run.channels[ANGLE][:n], run.dt)
        rest = run.channels[TORQUE][:n] - run.channels.get(SENSOR, np.zeros(n))[:n] - J * acceleration - b * rate
        repeats.append({TORQUE: sliding(rate) * band_limited(rest, run.dt, MOTION_HZ).signal()})
    _, rate, _ = motion(record.inputs[ANGLE], record.dt)
    outputs = {TORQUE: sliding(rate) * band_limited(record.outputs[TORQUE], record.dt, MOTION_HZ).signal()}
    return replace(record, outputs=outputs, repeats=tuple(repeats))
