"""A measurement campaign of kind "rig" out of a log of CAN frames, for ``steer-env identify`` and ``gap``.

What a log has goes into one run per stretch of time in which the drive was on and nothing was missing: angle, commanded
torque (held until the next command), and where the protocol has them rate and torque sensor, on an even grid.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import atomic
from steer_env.campaign_file import ANYTHING, SHORTEST, RunEntry, csv_text, toml_text
from steer_env.errors import InputError
from steer_env.rig.log_file import Log
from steer_env.rig.motors.motor import Motor
from steer_env.rig.replay import STATES, MotorDecoder, Replayed, aligned, replay

Array = NDArray[np.float64]
GAP = 0.02  # s without a sample at which a run ends
LONG_ENOUGH = SHORTEST[ANYTHING][0]  # s: shorter stretches are left out
ON = STATES.index("on")
# Signals of a motor by the campaign's names; the sensor's torque there resists the motor.
CHANNELS = {
    "angle_rad": ("motor_angle_rad", 1.0),
    "commanded_torque_Nm": ("motor_torque_Nm", 1.0),
    "sensor_torque_Nm": ("sensor_torque_Nm", -1.0),
    "rate_radps": ("motor_velocity_radps", 1.0),
}
HELD = ("commanded_torque_Nm",)


class Written(NamedTuple):
    """A run: its file, and its length in s."""

    file: str
    seconds: float


def write_campaign(
    folder: str | Path, log: Log, motor: Motor, name: str, manoeuvre: str = "free", period: float = 1e-3
) -> list[Written]:
    """Write a campaign of what a log holds of a motor; raises InputError where it holds too little.

    ``period`` in s is that of the grid; ``manoeuvre`` is what was driven (docs/formats.md).
    """
    if manoeuvre not in SHORTEST:
        raise InputError("manoeuvre", f"there is no {manoeuvre!r}", f"give one of {', '.join(SHORTEST)}")
    replayed = replay(log.frames, MotorDecoder(motor))
    spans = stretches(replayed)
    if not spans:
        raise InputError(
            f"log of {motor.name}",
            f"has no {LONG_ENOUGH:g} s in which the drive was on and answered at least every {1e3 * GAP:g} ms",
            "check --motor and its settings (node, increments_per_turn), or record a longer run",
        )
    written, runs = [], []
    with atomic.folder(folder) as staging:
        for k, (start, end) in enumerate(spans, 1):
            columns = run_columns(replayed, start, end, period)
            file = f"runs/{manoeuvre}_{k}.csv"
            (staging / "runs").mkdir(exist_ok=True)
            atomic.write_text(staging / file, csv_text(columns))
            seconds = float(columns["time_s"][-1])
            runs.append(RunEntry(file, manoeuvre if seconds >= SHORTEST[manoeuvre][0] else ANYTHING))
            written.append(Written(file, seconds))
        atomic.write_text(staging / "campaign.toml", toml_text(name, "rig", {"rig": {}}, runs))
    return written


def stretches(replayed: Replayed) -> list[tuple[float, float]]:
    """(start, end) in s of the times in which the drive was on, torques were commanded and samples came."""
    needed = ("angle_rad", "commanded_torque_Nm", "state")
    if any(name not in replayed.signals for name in needed):
        return []
    times = replayed.signals["angle_rad"][0]
    changes, states = replayed.signals["state"]
    commands = replayed.signals["commanded_torque_Nm"][0]
    at = np.searchsorted(changes, times, side="right") - 1
    last = np.searchsorted(commands, times, side="right") - 1
    good = (at >= 0) & (states[at] == ON) & (last >= 0) & (times - commands[last] < GAP)
    near = np.diff(times) < GAP
    found, start = [], None
    for k in range(times.size):
        if good[k] and start is None:
            start = k
        ends = start is not None and (k + 1 == times.size or not good[k + 1] or not near[k])
        if start is not None and ends:
            if times[k] - times[start] >= LONG_ENOUGH:
                found.append((float(times[start]), float(times[k])))
            start = None
    return found


def run_columns(replayed: Replayed, start: float, end: float, period: float) -> dict[str, Array]:
    """Columns of one run by the campaign's names, each [n]."""
    chosen = {}
    for name in CHANNELS:
        times, values = replayed.signals.get(name, (np.empty(0), np.empty(0)))
        # A command in force at the start was sent a little earlier.
        inside = (times >= start - (GAP if name in HELD else 0.0)) & (times <= end)
        if inside.sum() > 1:
            chosen[name] = times[inside] - start, values[inside]
    angle_times = chosen["angle_rad"][0]
    if "commanded_torque_Nm" in chosen:
        times, values = chosen["commanded_torque_Nm"]
        chosen["commanded_torque_Nm"] = np.append(times, angle_times[-1]), np.append(values, values[-1])
    grid, values_by_name = aligned(chosen, period, HELD)
    columns = {"time_s": grid}
    for name, values in values_by_name.items():
        column, sign = CHANNELS[name]
        columns[column] = sign * values
    return columns
