"""steer-env rig run: a controller on the motor for one episode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.rig_options import bus_options

CONFIRM = "The motor will turn the wheel with up to {cap:g} N m. Hands clear and the rig fixed? Type ARM"


@click.command()
@bus_options
@click.option("--controller", default="pid", show_default=True, help="A name of CONTROLLERS, or file.py:Class.")
@click.option("--causality", type=click.Choice(["impedance", "admittance"]), default="impedance", show_default=True)
@click.option("--reference", default="published", show_default=True, metavar="FILE", help="A reference.json.")
@click.option("--manoeuvre", default="frequency_response", show_default=True, help="Its length; who drives is you.")
@click.option("--speed-kmh", default=75.0, show_default=True)
@click.option("--duration", type=float, default=None, metavar="S", help="[default: the manoeuvre's]")
@click.option("--torque-cap", type=float, default=None, metavar="NM", help="[default: 2 N m, or the drive's rating]")
@click.option("--no-watchdog", is_flag=True, help="For a bus that only one process can open.")
@click.option("--arm", is_flag=True, help="Without it nothing is sent; asks once more.")
@click.option("--yes", is_flag=True, help="The answer to that question, for virtual motors and scripts.")
@common_options
def command(
    motor: str, settings: dict[str, Any], interface: str, channel: str, bitrate: int | None, port: int,
    controller: str, causality: str, reference: str, manoeuvre: str, speed_kmh: float, duration: float | None,
    torque_cap: float | None, no_watchdog: bool, arm: bool, yes: bool,
    out: Path, seed: int, jobs: int, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Run a controller on a motor: the wheel shall feel like the reference."""
    import gymnasium
    import numpy as np

    import controllers
    import steer_env.rig.rig_env  # noqa: F401  (loaded before a motor waits)
    from steer_env import atomic
    from steer_env.envs.layout import Truth
    from steer_env.rig.recorder import Recorder

    recorder = Recorder(out)
    env = gymnasium.make(
        f"steer_env/Rig-{causality.capitalize()}-v0",
        motor=motor, motor_options=settings, interface=interface, channel=channel, port=port, bitrate=bitrate,
        torque_cap=torque_cap, watchdog=False if no_watchdog else None, tap=recorder.frame,
        reference=reference, manoeuvre=manoeuvre, speed_kmh=speed_kmh, duration=duration,
    )  # fmt: skip
    inside: Any = env.unwrapped
    law = controllers.make(controller, inside.plant, inside.reference, causality)
    cap = inside.connection.limits_of(inside.connection.codec()).torque_cap
    if arm and (yes or click.prompt(CONFIRM.format(cap=cap), default="", show_default=False, err=True) == "ARM"):
        inside.unlock()
    rows, late = [], []
    with recorder, env, progress("rig run", inside.periods // 100, quiet) as advance:
        _, info = env.reset(seed=seed)
        law.reset(inside.session.pacer.period)
        while not info["ended"]:
            *_, info = env.step(inside.action_for(law(info["observation"])))
            rows.append([info[name] for name in Truth._fields])
            late.append(info["rig"]["late"])
            if len(rows) % 100 == 0:
                advance()
        overruns, ended = info["rig"]["overruns"], info["ended"]
    signals = np.array(rows)
    lines = [",".join(Truth._fields), *(",".join(f"{value:.9g}" for value in row) for row in signals)]
    path = out / "signals.csv"
    atomic.write_text(path, "\n".join(lines) + "\n")
    error = signals[:, Truth._fields.index("error")]
    result = {
        "ended": ended,
        "seconds": float(signals[-1, 0]),
        "rms_error": float(np.sqrt(np.mean(error * error))),
        "late_p50_ms": 1e3 * float(np.median(late)),
        "late_p99_ms": 1e3 * float(np.percentile(late, 99)),
        "overruns": overruns,
        "signals": str(path),
        "log": str(recorder.paths[0]),
    }
    print_json(result) if as_json else print_table(list(result), [list(result.values())])
