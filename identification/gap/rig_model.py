"""A rig campaign as the gap workflow sees it: the torque that a measured motion needs, against the commanded torque.

A simulation led by the torque would drift, as the angle is its double integral. The other way round everything is
measured: J q'' + b q' plus what the effects resist must be what was commanded (less what a torque sensor took).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identification.campaign import Campaign, KnownRig, Run, require
from identification.frf import Floats
from identification.gap.basis import white_noise
from identification.gap.model import Present, Record, Unknown, Values, sliding
from identification.gap.repeats import SETTLE_S, records_of
from identification.gap.vehicle_model import late
from identification.motion import band_limited
from steer_env.errors import InputError
from steer_env.physics._jit import compiled
from steer_env.physics.bench import contact_impulse, friction_after, resisting_torque
from steer_env.physics.effects import EFFECTS, Effect
from steer_env.physics.effects import rig_ports as ports
from steer_env.physics.effects.rig_moment import RigMoment

ANGLE, TORQUE, SENSOR = "motor_angle_rad", "motor_torque_Nm", "sensor_torque_Nm"
REST = "torque left by the nominal model"  # a channel of our own beside a run's: in it repeats differ by their noise
LEAST_INERTIA = 1e-5  # kg m2; no motor on a bench has less
REST_RATE = 0.03  # rad/s below which the motor counts as at rest: three encoder steps of 0.009 deg in 16 ms
# The motion is used up to the frequency at which the twice differentiated encoder's noise, integrated up to there, is
# this share of the torque; within these limits in Hz and below this share of the sampling frequency.
ENCODER_SHARE = 0.01
NARROWEST_HZ, WIDEST_HZ, OF_SAMPLING = 6.0, 30.0, 0.4
IMPACT_SHARE = 0.15  # of a record's own torque: where flanks meet, a wide band counts more than little noise
JUDGED_SHARE = 2.0 / 3.0  # of the motion's band: torques are judged where friction's harmonics are still whole


@compiled
def resisted(
    angle: Floats, rate: Floats, acceleration: Floats, sharp: Floats, load: Floats, dt: float, J: float, b: float,
    row: Any,
) -> Floats:  # fmt: skip
    """Torque in N m [n] that a motion in rad, rad/s, rad/s2 [n] needs, ``load`` in N m [n] taken off the wheel.

    ``sharp`` is the angle in a wider band: flanks meet within milliseconds, and the band limit of a motion that is to
    be differentiated twice would soften the impact.
    """
    n = angle.size
    out = np.zeros(n)
    friction, play = 0.0, 0.0
    wheel_rate = rate[0]
    for k in range(n):
        x = RigMoment(angle[k], rate[k])
        friction = friction_after(friction, angle[k] - angle[k - 1] if k > 0 else 0.0, x, row)
        half, share = ports.half_gap(x, row), ports.wheel_share(x, row)
        if half > 0.0 and k < n - 1:
            # From here to the next sample, so that what the contact gives is centred on this one.
            motor_rate = (sharp[k + 1] - sharp[k]) / dt
            free = wheel_rate - dt * load[k] / (share * J)
            impulse = contact_impulse(play, motor_rate - free, half, 1.0 / (share * J), dt)
            wheel_rate = free + impulse / (share * J)
            play += dt * (motor_rate - wheel_rate)
            inertial = (1.0 - share) * J * acceleration[k] + b * rate[k] + impulse / dt
        else:
            inertial = J * acceleration[k] + b * rate[k] + load[k]
        out[k] = inertial + resisting_torque(x, friction, row)
    return out


@dataclass
class RigModel:
    """J q'' + b q' = motor torque - sensor torque, for one campaign (``model.Model``).

    ``motion_Hz``: frequency up to which the measured motion is used; torques are judged up to ``band_Hz``.
    """

    records: tuple[Record, ...]
    unknowns: tuple[Unknown, ...]
    effects: Mapping[str, Effect]
    motion_Hz: float
    band_Hz: float
    channels: tuple[str, ...] = (TORQUE,)
    _motions: dict[str, tuple[Floats, Floats, Floats, Floats]] = field(default_factory=dict, repr=False)

    def simulate(self, record: Record, values: Values, present: Present) -> dict[str, Floats]:
        """The torque [n] that should have been commanded; see ``model.Model``."""
        angle, rate, acceleration, sharp = self._motion(record)
        row = ports.rig_row(present) if any(name in ports.RIG_MECHANICAL for name in present) else None
        load = record.inputs.get(SENSOR, np.zeros_like(angle))
        torque = resisted(angle, rate, acceleration, sharp, load, record.dt, values["J"], values["b"], row)
        torque = torque - present.get("torque_offset", {}).get("Nm", 0.0)
        torque = torque / present.get("torque_gain", {}).get("ratio", 1.0)
        # A command is held until the next one, so it acts half a sample late by nature.
        delay = 0.5 * record.dt + present.get("command_latency", {}).get("delay_s", 0.0)
        early = late(torque, -delay / record.dt)
        return {TORQUE: sliding(rate, REST_RATE) * band_limited(early, record.dt, self.motion_Hz).signal()}

    def judged(self, outputs: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The torque itself."""
        return outputs

    def states(self, record: Record) -> dict[str, Floats]:
        """Angle, rate and acceleration [n]."""
        angle, rate, acceleration, _ = self._motion(record)
        return {"motor angle": angle, "motor rate": rate, "motor acceleration": acceleration}

    def _motion(self, record: Record) -> tuple[Floats, Floats, Floats, Floats]:
        key = f"{record.name} {record.role}"
        if key not in self._motions:
            logged, J = record.inputs[ANGLE], self.unknowns[0].start
            wide = quiet_band(logged, record.dt, J, IMPACT_SHARE * float(np.std(record.outputs[TORQUE])))
            sharp = band_limited(logged, record.dt, min(max(wide, self.motion_Hz), OF_SAMPLING / record.dt))
            self._motions[key] = (*motion(logged, record.dt, self.motion_Hz), sharp.signal())
        return self._motions[key]


def motion(angle: Floats, dt: float, motion_Hz: float) -> tuple[Floats, Floats, Floats]:
    """Angle, rate and acceleration [n] of a measured angle in rad, band-limited without phase."""
    limited = band_limited(angle, dt, motion_Hz)
    rate = limited.rate()
    return limited.signal(), rate.signal(), rate.rate().signal()


def rig_model(campaign: Campaign) -> RigModel:
    """Records and unknowns of a rig campaign; an ``InputError`` where angle or torque lacks."""
    if campaign.kind != "rig":
        raise InputError(f"{campaign.folder}: kind", f"'{campaign.kind}' is not 'rig'", "give a rig campaign")
    for run in campaign.runs:
        require(run, [ANGLE, TORQUE], "the gap workflow")
    fitted = [run for run in campaign.runs if run.role == "identify"]
    J, _ = start_values(fitted, NARROWEST_HZ, campaign.rig)
    motion_Hz = usable_band(fitted, J)
    J, b = start_values(fitted, motion_Hz, campaign.rig)
    runs = [_with_rest(run, J, b, motion_Hz) for run in campaign.runs]
    records = records_of(runs, ANGLE, (ANGLE, SENSOR), (TORQUE, REST))
    unknowns = (
        Unknown("J", J, 0.2 * J, 5.0 * J, 0.5),
        Unknown("b", b, -5.0, 20.0, 0.2, log=False),
    )
    with_sensor = any(SENSOR in record.inputs for record in records)
    effects = {
        name: effect for name, effect in EFFECTS["rig"].items() if with_sensor or SENSOR not in effect.needs
    }
    judged = tuple(_judged(record, motion_Hz) for record in records)
    return RigModel(judged, unknowns, effects, motion_Hz, JUDGED_SHARE * motion_Hz)


def usable_band(runs: Sequence[Run], J: float) -> float:
    """Frequency in Hz up to which the motion of all runs is used."""
    torque = float(np.sqrt(np.mean([np.var(run.channels[TORQUE]) for run in runs])))
    found = min(quiet_band(run.channels[ANGLE], run.dt, J, ENCODER_SHARE * torque) for run in runs)
    return float(np.clip(found, NARROWEST_HZ, min(WIDEST_HZ, *(OF_SAMPLING / run.dt for run in runs))))


def quiet_band(angle: Floats, dt: float, J: float, torque: float) -> float:
    """Frequency in Hz up to which the noise of an angle in rad makes no more than ``torque`` in N m of J q''.

    White noise of s rad rms, sampled every dt and used up to f, makes J (2 pi f)^2 s sqrt(2 dt f / 5).
    """
    noise = J * (2.0 * np.pi) ** 2 * white_noise(angle) * float(np.sqrt(0.4 * dt))
    return float((torque / noise) ** 0.4) if noise > 0.0 else np.inf


def start_values(runs: Sequence[Run], motion_Hz: float, known: KnownRig | None = None) -> tuple[float, float]:
    """Least-squares J in kg m2 and b in N m s/rad over runs; what is known of the rig where they show no inertia."""
    table, torque = [], []
    for run in runs:
        _, rate, acceleration = motion(run.channels[ANGLE], run.dt, motion_Hz)
        taken = run.channels[TORQUE] - run.channels.get(SENSOR, np.zeros_like(rate))
        limited = band_limited(taken, run.dt, motion_Hz).signal()
        margin = min(round(SETTLE_S / run.dt), rate.size // 5)  # what lies beyond an end of the log is not known
        inner = slice(margin, rate.size - margin)
        table.append(np.column_stack([acceleration, rate])[inner])
        torque.append(limited[inner])
    (J, b), *_ = np.linalg.lstsq(np.concatenate(table), np.concatenate(torque), rcond=None)
    if J > LEAST_INERTIA:
        return float(J), float(b)
    J_known, b_known = (None, None) if known is None else known
    return J_known or LEAST_INERTIA, float(b) if b_known is None else b_known


def _with_rest(run: Run, J: float, b: float, motion_Hz: float) -> Run:
    """The run with REST: the torque in N m [n] that nominal start values leave over while the motor moves.

    Repeats of one command are equal to the bit; what differs is the motion that they cause and how it is measured.
    """
    _, rate, acceleration = motion(run.channels[ANGLE], run.dt, motion_Hz)
    rest = run.channels[TORQUE] - run.channels.get(SENSOR, np.zeros_like(rate)) - J * acceleration - b * rate
    moving = np.asarray(sliding(rate, REST_RATE) * band_limited(rest, run.dt, motion_Hz).signal(), dtype=np.float64)
    return replace(run, channels={**run.channels, REST: moving})


def _judged(record: Record, motion_Hz: float) -> Record:
    """The record with its torque band-limited while moving; the noise of its repeats is that of the nominal rest."""
    _, rate, _ = motion(record.inputs[ANGLE], record.dt, motion_Hz)
    torque = sliding(rate, REST_RATE) * band_limited(record.outputs[TORQUE], record.dt, motion_Hz).signal()
    repeats = tuple({TORQUE: repeat[REST]} for repeat in record.repeats)
    return replace(record, outputs={TORQUE: torque}, repeats=repeats)
