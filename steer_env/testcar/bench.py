"""The virtual bench: a force-feedback wheel on its motor, torque commanded, angle logged.

Commands are sweeps and slow sines with a weak position loop that keeps the wheel near its middle, and releases; all of
it is in the commanded torque. Two settings of commanded damping. The wheel is nearly the nominal model: a little
friction and cogging is left, far below what the catalogue calls an effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env import atomic
from steer_env.physics._jit import compiled
from steer_env.physics.bench import engaged_share, friction_after, resisting_torque, wheel_after
from steer_env.physics.effects.rig_moment import RigMoment
from steer_env.physics.effects.rig_ports import rig_row
from steer_env.physics.effects.rig_table import RIG_EFFECTS
from steer_env.testcar.campaign_writer import write_run
from steer_env.units import Quantity

Array = NDArray[np.floating]
LOG_PERIOD = 2e-3  # s
SUBSTEPS = 8
ENCODER_STEP = 1.5708e-4  # rad, 0.009 deg
LONGEST_DELAY = 512  # substeps
HONEST = {
    "presliding_friction": {"level_Nm": 0.004, "travel_rad": 0.02},
    "torque_ripple": {"amplitude_Nm": 0.002, "order": 21.0, "phase": 0.4},
}


class Bench(NamedTuple):
    """Motor with a steering wheel on it."""

    J: Annotated[float, Quantity("kg m2", "rotor and wheel", 1e-4, 1.0, "assumption: a 0.35 m wheel")] = 0.042
    b: Annotated[float, Quantity("N m s/rad", "bearing damping", 0.0, 5.0, "assumption")] = 0.03
    torque_noise: Annotated[float, Quantity("N m", "torque ripple of the drive, rms", 0.0, 1.0, "assumption")] = 0.005


@compiled
def bench_rollout(
    feed: Array, stiffness: float, damping: float, noise: Array, delay: int, gain: float, offset: float, J: float,
    b: float, row: Any, honest: Any,
) -> Array:  # fmt: skip
    """Record [n, 2] of angle in rad and commanded torque in N m at LOG_PERIOD.

    ``feed`` [n] in N m is commanded besides the position loop's ``stiffness`` and ``damping``; ``noise`` [n] in N m
    acts unseen. The command acts ``delay`` substeps later, times ``gain``, plus ``offset``.
    """
    n = feed.size
    record = np.zeros((n, 2))
    line = np.zeros(LONGEST_DELAY)
    h = LOG_PERIOD / SUBSTEPS
    angle, rate, friction, rest, wheel = 0.0, 0.0, 0.0, 0.0, 0.0
    share, place = 1.0, 0
    for k in range(n):
        command = feed[k] - stiffness * angle - damping * rate
        record[k, 0], record[k, 1] = angle, command
        for _ in range(SUBSTEPS):
            line[place % LONGEST_DELAY] = command
            acting = gain * line[(place - delay) % LONGEST_DELAY] + offset + noise[k]
            place += 1
            x = RigMoment(angle, rate)
            resist = resisting_torque(x, friction, row) + resisting_torque(x, rest, honest) + b * share * rate
            rate += h * (acting - resist) / (J * share)
            moved = h * rate
            angle += moved
            y = RigMoment(angle, rate)
            friction = friction_after(friction, moved, y, row)
            rest = friction_after(rest, moved, y, honest)
            before, wheel = wheel, wheel_after(wheel, angle, row)
            share = engaged_share(wheel - before, moved)
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


def bench_campaign(
    folder: Path, hidden: Mapping[str, Mapping[str, float]], seed: int, repeats: int = 3, bench: Bench | None = None
) -> None:
    """Write a rig campaign with effects of the rig's catalogue in the bench; nothing in it tells which."""
    p = bench or Bench()
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(7,)))
    row = rig_row(hidden) if any(RIG_EFFECTS[name].ports for name in hidden) else None
    honest = rig_row(HONEST)
    delay = hidden.get("command_latency", {}).get("delay_s", 0.0)
    gain = hidden.get("torque_gain", {}).get("ratio", 1.0)
    offset = hidden.get("torque_offset", {}).get("Nm", 0.0)
    steps = round(delay / LOG_PERIOD * SUBSTEPS)
    lines = ["schema_version = 1", 'name = "virtual bench"', 'kind = "rig"', "", "[rig]", "inertia_kgm2 = 0.04"]
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    for setting, damping in (("a", 0.05), ("b", 0.25)):
        for name, (manoeuvre, feed) in feeds().items():
            for repeat in range(1, repeats + 1):
                noise = p.torque_noise * rng.standard_normal(feed.size)
                record = bench_rollout(feed, 1.5, damping, noise, steps, gain, offset, p.J, p.b, row, honest)
                angle = ENCODER_STEP * np.round(record[:, 0] / ENCODER_STEP)
                file = f"runs/{setting}_{name}_{repeat}.csv"
                time = LOG_PERIOD * np.arange(feed.size)
                columns = {"time_s": time, "motor_angle_rad": angle, "motor_torque_Nm": record[:, 1]}
                write_run(folder / file, columns)
                lines += ["", "[[runs]]", f'file = "{file}"', f'manoeuvre = "{manoeuvre}"', 'role = "auto"']
    atomic.write_text(folder / "campaign.toml", "\n".join(lines) + "\n")
