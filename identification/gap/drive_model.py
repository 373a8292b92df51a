"""A drive's log as the gap workflow sees it: torque = c(v) angle + b rate + bias, judged while the wheel slides.

Every second stretch of BLOCK_S seconds is held out, before anything is fitted. A driver's torque leads and follows
the road at once, and nothing is repeated: what is named here says less than a campaign would.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from identification.campaign import Campaign
from identification.drive_blocks import speed_knots
from identification.drive_signals import DriveSignals, prepare
from identification.frf import Floats
from identification.gap.model import Present, Record, Unknown, Values, sliding
from identification.gap.vehicle_model import late
from steer_env.errors import InputError
from steer_env.physics._jit import compiled
from steer_env.physics.effects import EFFECTS, Effect
from steer_env.physics.effects import drive_ports as ports
from steer_env.physics.effects.drive_effects import DriveMoment
from steer_env.physics.friction import dahl_over

TORQUE = "steering_torque_Nm"
BLOCK_S = 20.0  # longer than a residual of a drive stays coloured, short enough for ten stretches in a few minutes
CUTOFF_HZ, SLIDING_RATE, KNOTS = 5.0, 0.04, 3  # as ``identification.drive.DriveModel``; fewer knots, as half is fitted
BAND_HZ = 5.0


@compiled
def wheel_torque(angle: Floats, rate: Floats, stiffness: Floats, damping: float, bias: float, row: object) -> Floats:
    """Torque in N m [n] at the wheel for an angle in rad, a rate in rad/s and a stiffness in N m/rad, each [n]."""
    n = angle.size
    out = np.zeros(n)
    friction = 0.0
    for k in range(n):
        x = DriveMoment(angle[k], rate[k], k / n)
        travel = angle[k] - angle[k - 1] if k > 0 else 0.0
        friction = dahl_over(friction, travel, ports.friction_level(x, row), ports.friction_travel(x, row))
        centring = stiffness[k] * (angle[k] + ports.angle(x, row))
        out[k] = centring + damping * rate[k] + bias + friction + ports.torque(x, row)
    return out


@dataclass
class DriveGapModel:
    """The log of one or more drives (``model.Model``)."""

    records: tuple[Record, ...]
    unknowns: tuple[Unknown, ...]
    effects: Mapping[str, Effect]
    speeds: Floats
    signals: Mapping[str, DriveSignals]
    channels: tuple[str, ...] = (TORQUE,)
    band_Hz: float = BAND_HZ

    def simulate(self, record: Record, values: Values, present: Present) -> dict[str, Floats]:
        """Torque [n] while sliding, zero at rest; see ``model.Model``."""
        s = self.signals[record.manoeuvre]
        stiffness = np.interp(s.speed, self.speeds, [values[f"c{k}"] for k in range(len(self.speeds))])
        row = ports.drive_row(present) if any(name in ports.DRIVE_MECHANICAL for name in present) else None
        torque = wheel_torque(s.angle, s.rate, stiffness, values["b"], values["bias"], row)
        delay = present.get("latency_torque", {}).get("delay_s", 0.0)
        if delay:
            torque = late(torque, delay / record.dt)
        return {TORQUE: sliding(s.rate, SLIDING_RATE) * torque}

    def judged(self, outputs: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The torque itself."""
        return outputs

    def states(self, record: Record) -> dict[str, Floats]:
        """Angle, rate and speed [n]."""
        s = self.signals[record.manoeuvre]
        return {"steering angle": s.angle, "steering rate": s.rate, "speed": s.speed}


def drive_model(campaign: Campaign) -> DriveGapModel:
    """Stretches and unknowns of a drive; an ``InputError`` where it is too short to fit and to hold out."""
    if campaign.kind != "drive":
        raise InputError(f"{campaign.folder}: kind", f"'{campaign.kind}' is not 'drive'", "give a drive campaign")
    signals = {run.name: prepare(run, CUTOFF_HZ, SLIDING_RATE) for run in campaign.runs}
    speeds = speed_knots(list(signals.values()), KNOTS)
    records: list[Record] = []
    for run in campaign.runs:
        s = signals[run.name]
        torque = {TORQUE: sliding(s.rate, SLIDING_RATE) * s.torque}
        step = round(BLOCK_S / run.dt)
        for index, start in enumerate(range(0, s.time.size - step // 2, step)):
            keep = slice(start, min(start + step, s.time.size))
            role = "identify" if index % 2 == 0 else "validate"
            name = f"{run.name}, {start * run.dt:.0f} s"
            records.append(Record(name, run.name, 0.0, run.speed, run.dt, {}, torque, keep, role, (torque,)))
    if len(records) < 4:
        raise InputError(
            f"{campaign.folder}: runs",
            f"the drive has {len(records)} stretches of {BLOCK_S:g} s",
            "log a minute and a half or more: half of it is held out",
        )
    unknowns = (
        *(Unknown(f"c{k}", 2.0, -50.0, 200.0, 10.0, log=False) for k in range(len(speeds))),
        Unknown("b", 0.2, -10.0, 20.0, 1.0, log=False),
        Unknown("bias", 0.0, -10.0, 10.0, 1.0, log=False),
    )
    return DriveGapModel(tuple(records), unknowns, EFFECTS["drive"], speeds, signals)
