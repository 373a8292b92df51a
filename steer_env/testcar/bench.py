"""The virtual bench: a force-feedback wheel on its motor, torque commanded, angle logged.

Commands are sweeps and slow sines with a weak position loop that keeps the wheel near its middle, and releases; all of
it is in the commanded torque. Two settings of commanded damping. The wheel is nearly the nominal model: a little
friction and cogging is left, far below what the catalogue calls an effect. Optionally the wheel is loaded through a
torque sensor, by a damper and by a spring whose other end is moved to and fro.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import atomic
from steer_env.physics._jit import compiled
from steer_env.physics.bench import contact_impulse, friction_after, resisting_torque
from steer_env.physics.effects import EFFECTS
from steer_env.physics.effects import rig_ports as ports
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.testcar.campaign_writer import write_run
from steer_env.units import Quantity

Array = NDArray[np.floating]
SENSOR = "sensor_torque_Nm"
LOG_PERIOD = 2e-3  # s
SUBSTEPS = 8
STEP = LOG_PERIOD / SUBSTEPS  # s
ENCODER_STEP = 1.5708e-4  # rad, 0.009 deg
SENSOR_STEP, SENSOR_NOISE = 0.03, 0.01  # N m, as the paper's rig
SWING = (2.3, 8.2)  # rad/s, of the load's own motion
LINE = 1024  # substeps of command that are remembered
HONEST = {
    "presliding_friction": {"level_Nm": 0.004, "travel_rad": 0.02},
    "torque_ripple": {"amplitude_Nm": 0.002, "order": 21.0, "phase": 0.4},
}
RECORD = ("angle", "command", "load", "rate", "wheel_rate", "play")
Hidden = Mapping[str, Mapping[str, float]]


class Bench(NamedTuple):
    """Motor with a steering wheel on it."""

    J: Annotated[float, Quantity("kg m2", "rotor and wheel", 1e-4, 1.0, "assumption: a 0.35 m wheel")] = 0.042
    b: Annotated[float, Quantity("N m s/rad", "bearing damping", 0.0, 5.0, "assumption")] = 0.03
    torque_noise: Annotated[float, Quantity("N m", "torque ripple of the drive, rms", 0.0, 1.0, "assumption")] = 0.005
    load_stiffness: Annotated[float, Quantity("N m/rad", "spring behind the sensor", 0.0, 100.0, "no load")] = 0.0
    load_damping: Annotated[float, Quantity("N m s/rad", "damper behind the sensor", 0.0, 5.0, "no load")] = 0.0
    load_swing: Annotated[float, Quantity("rad", "by which the spring's other end is moved", 0.0, 2.0, "no load")] = 0.0


# The load moves on its own: one that only follows the wheel cannot tell a gain from a spring and other J and b.
LOADED = Bench(load_stiffness=2.0, load_damping=0.1, load_swing=0.4)


class Command(NamedTuple):
    """What acts of a command: position loop in N m/rad and N m s/rad; ``delay`` in s, ``gain``, ``offset`` in N m."""

    stiffness: float = 1.5
    damping: float = 0.05
    delay: float = 0.0
    gain: float = 1.0
    offset: float = 0.0


@compiled
def bench_rollout(feed: Array, noise: Array, c: Command, p: Bench, row: Any, honest: Any) -> Array:
    """Record [n, len(RECORD)] at LOG_PERIOD, SI.

    ``feed`` [n] in N m is commanded besides the position loop, ``noise`` [n] in N m acts unseen; ``row`` and ``honest``
    are rows of effects. A command is held until the next one.
    """
    n = feed.size
    record = np.zeros((n, len(RECORD)))
    line = np.zeros(LINE)
    # Half a step more: a semi-implicit Euler step lets a torque act half a step early.
    delay = c.delay / STEP + 0.5
    whole = int(delay)
    late = delay - whole
    half_damping = 0.5 * STEP * p.b  # damping by the mean rate of a step
    angle, rate, play, wheel_rate = 0.0, 0.0, 0.0, 0.0
    friction, rest = 0.0, 0.0
    place = 0
    for k in range(n):
        command = feed[k] - c.stiffness * angle - c.damping * rate
        t = k * LOG_PERIOD
        held = p.load_swing * (math.sin(SWING[0] * t) + 0.5 * math.sin(SWING[1] * t))
        load = p.load_stiffness * (angle - play - held) + p.load_damping * wheel_rate
        record[k, 0], record[k, 1], record[k, 2] = angle, command, load
        record[k, 3], record[k, 4], record[k, 5] = rate, wheel_rate, play
        for _ in range(SUBSTEPS):
            line[place % LINE] = command
            due = (1.0 - late) * line[(place - whole) % LINE] + late * line[(place - whole - 1) % LINE]
            place += 1
            x = RigMoment(angle, rate)
            torque = c.gain * due + c.offset + noise[k] - resisting_torque(x, friction, row)
            torque -= resisting_torque(x, rest, honest)
            load = p.load_stiffness * (angle - play - held) + p.load_damping * wheel_rate
            half, share = ports.half_gap(x, row), ports.wheel_share(x, row)
            if half > 0.0:
                J_motor, J_wheel = p.J * (1.0 - share), p.J * share
                rate += STEP * (torque - p.b * rate) / (J_motor + half_damping)
                wheel_rate -= STEP * load / J_wheel
                impulse = contact_impulse(play, rate - wheel_rate, half, 1.0 / J_motor + 1.0 / J_wheel, STEP)
                rate -= impulse / J_motor
                wheel_rate += impulse / J_wheel
                play += STEP * (rate - wheel_rate)
            else:
                rate += STEP * (torque - load - p.b * rate) / (p.J + half_damping)
                wheel_rate = rate
            moved = STEP * rate
            angle += moved
            y = RigMoment(angle, rate)
            friction = friction_after(friction, moved, y, row)
            rest = friction_after(rest, moved, y, honest)
    return record


def feeds() -> dict[str, tuple[str, Array]]:
    """What is commanded: manoeuvre and torque in N m [n] by a run's name."""
    t = np.arange(0.0, 24.0, LOG_PERIOD)
    sweep = np.sin(2.0 * np.pi * (0.2 * t + 0.5 * 9.8 / 24.0 * t * t))
    slow = np.sin(2.0 * np.pi * 0.25 * t)
    steps = np.where((t % 4.0) < 2.0, 1.0, -1.0) * (t < 20.0)
    return {
        "sweep_small": ("torque_sweep", 1.5 * sweep),
        "sweep_large": ("torque_sweep", 4.0 * sweep),
        "sine_small": ("steady_state", 1.5 * slow),
        "sine_large": ("steady_state", 4.0 * slow),
        "release": ("release", 2.0 * steps),
    }


def bench_for(hidden: Hidden, seed: int) -> Bench:
    """A bench with a load and a torque sensor if something hidden cannot be seen without; else by a coin.

    The coin is there so that a sensor does not tell what is hidden.
    """
    needed = any(SENSOR in EFFECTS["rig"][name].needs for name in hidden)
    coin = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(8,))).random() < 0.5
    return LOADED if needed or coin else Bench()


def bench_campaign(
    folder: Path, hidden: Hidden, seed: int, repeats: int = 3, bench: Bench | None = None, clean: bool = False
) -> None:
    """Write a rig campaign with effects of the rig's catalogue in the bench; nothing in it tells which.

    ``bench`` with a load (``LOADED``) is logged with a torque sensor. ``clean``: no noise, no rounding, none of the
    friction and cogging that is left on an ordinary bench.
    """
    p = bench or Bench()
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(7,)))
    row = ports.rig_row(hidden) if any(name in ports.RIG_MECHANICAL for name in hidden) else None
    honest = None if clean else ports.rig_row(HONEST)
    command = Command(
        delay=hidden.get("command_latency", {}).get("delay_s", 0.0),
        gain=hidden.get("torque_gain", {}).get("ratio", 1.0),
        offset=hidden.get("torque_offset", {}).get("Nm", 0.0),
    )
    loaded = p.load_stiffness > 0.0 or p.load_damping > 0.0
    lines = ["schema_version = 1", 'name = "virtual bench"', 'kind = "rig"', "", "[rig]", "inertia_kgm2 = 0.04"]
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    for setting, damping in (("a", 0.05), ("b", 0.25)):
        for name, (manoeuvre, feed) in feeds().items():
            for repeat in range(1, repeats + 1):
                noise = (0.0 if clean else p.torque_noise) * rng.standard_normal(feed.size)
                record = bench_rollout(feed, noise, command._replace(damping=damping), p, row, honest)
                columns = logged(record, loaded, None if clean else rng)
                file = f"runs/{setting}_{name}_{repeat}.csv"
                write_run(folder / file, columns)
                lines += ["", "[[runs]]", f'file = "{file}"', f'manoeuvre = "{manoeuvre}"', 'role = "auto"']
    atomic.write_text(folder / "campaign.toml", "\n".join(lines) + "\n")


def logged(record: Array, loaded: bool, rng: np.random.Generator | None) -> dict[str, Array]:
    """Columns of a run's file, each [n]; ``rng`` None: without noise and rounding."""
    angle, command, load = record[:, 0], record[:, 1], record[:, 2]
    if rng is not None:
        angle = ENCODER_STEP * np.round(angle / ENCODER_STEP)
    columns = {
        "time_s": LOG_PERIOD * np.arange(angle.size), "motor_angle_rad": angle, "motor_torque_Nm": command,
    }  # fmt: skip
    if loaded:
        if rng is not None:
            load = SENSOR_STEP * np.round((load + SENSOR_NOISE * rng.standard_normal(load.size)) / SENSOR_STEP)
        columns[SENSOR] = load
    return columns
