"""steer-env rig run: a controller on the motor, recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options
from experiments.rig_options import arm_options, bus_options, fresh, unlocked

CONFIRM = "The motor will turn the wheel with up to {cap:g} N m. Hands clear and the rig fixed? Type ARM"


@click.command()
@bus_options
@click.option("--controller", default="pid", show_default=True, help="A name of CONTROLLERS, or file.py:Class.")
@click.option("--causality", type=click.Choice(["impedance", "admittance"]), default="impedance", show_default=True)
@click.option("--reference", default="published", show_default=True, metavar="FILE", help="A reference.json.")
@click.option("--manoeuvre", default="frequency_response", show_default=True, help="Its length; who drives is you.")
@click.option("--speed-kmh", default=75.0, show_default=True)
@click.option("--duration", type=float, default=None, metavar="S", help="[default: the manoeuvre's]")
@click.option("--repeats", type=click.IntRange(1, 50), default=1, show_default=True, metavar="N", help="Episodes.")
@click.option(
    "--kind", type=click.Choice(["rig", "vehicle"]), default="rig", show_default=True,
    help="Of the campaign: the motor's signals, or those of a car with this steering.",
)  # fmt: skip
@arm_options
@common_options
@click.pass_context
def command(
    ctx: click.Context, motor: str, settings: dict[str, Any], interface: str, channel: str, bitrate: int | None,
    port: int, controller: str, causality: str, reference: str, manoeuvre: str, speed_kmh: float,
    duration: float | None, repeats: int, kind: str, torque_cap: float | None, patience: float, no_watchdog: bool,
    mf4: bool, arm: bool, yes: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Run a controller on a motor: the wheel shall feel like the reference.

    Every frame goes to OUT/rig.blf and rig.log; each episode becomes a run of a campaign in OUT, for 'identify' and
    'gap', and signals_N.csv, with reference and tracking error. Exit status 1 if the rig trips. --interface stepped is
    a virtual motor in this process, driven by a virtual arm, on a clock of its own.
    """
    import controllers
    from experiments.rig_episodes import play, recorded, report, write_signals

    del jobs
    options = {
        "motor": motor, "motor_options": settings, "interface": interface, "channel": channel, "port": port,
        "bitrate": bitrate, "torque_cap": torque_cap, "watchdog": False if no_watchdog else None,
        "patience": patience, "reference": reference, "manoeuvre": manoeuvre, "speed_kmh": speed_kmh,
        "duration": duration,
    }  # fmt: skip
    played = []
    with recorded(fresh(ctx, out), options, causality, kind, mf4) as rig:
        inside: Any = rig.env.unwrapped
        law = controllers.make(controller, inside.plant, inside.reference, causality)
        for k in range(repeats):
            unlocked(inside, CONFIRM, arm, yes or k > 0)
            played.append(play(rig.env, law, seed + k, f"{k + 1} of {repeats}", quiet))
            write_signals(rig.campaign.with_name(f"signals_{k + 1}.csv"), played[-1])
            if played[-1].ended.startswith("tripped"):
                break
    report(ctx, played, rig, as_json)
