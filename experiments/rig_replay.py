"""steer-env rig replay: a log of CAN frames through the decoders: what it says, how regularly, and a campaign of it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from experiments.cli_options import common_options, print_json, print_table
from experiments.rig_options import settings_option
from steer_env.rig.motors import MOTORS


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--motor", type=click.Choice(list(MOTORS)), default=None, help="Whose frames they are.")
@settings_option
@click.option("--dbc", type=click.Path(path_type=Path), default=None, help="Decode by this file instead.")
@click.option("--campaign", is_flag=True, help="Write a campaign of kind rig, for identify and gap, to --out.")
@click.option("--manoeuvre", default="free", show_default=True, metavar="NAME", help="What was driven.")
@click.option("--mf4", is_flag=True, help="Write the frames, and the campaign's runs, as MF4 to OUT/mf4.")
@common_options
def command(
    log: Path,
    motor: str | None,
    settings: dict[str, Any],
    dbc: Path | None,
    campaign: bool,
    manoeuvre: str,
    mf4: bool,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Play LOG (.blf, candump .log, .asc, ...) back into a motor's decoder, or one by a .dbc file.

    Prints, per identifier, how many frames there were, how regular they came, and how many could not be believed.
    """
    from steer_env.campaign_mf4 import require_asammdf
    from steer_env.rig.campaign import write_campaign
    from steer_env.rig.log_file import read_log
    from steer_env.rig.mf4 import as_mf4
    from steer_env.rig.motors import make
    from steer_env.rig.motors.dbc import dbc_of
    from steer_env.rig.replay import DbcDecoder, Decoder, MotorDecoder, replay

    del seed, jobs
    if (motor is None) == (dbc is None):
        raise click.UsageError("Give either --motor or --dbc.")
    if campaign and motor is None:
        raise click.UsageError("--campaign needs --motor.")
    if mf4:
        require_asammdf("--mf4")
    decoder: Decoder = DbcDecoder(dbc) if dbc is not None else MotorDecoder(make(str(motor), **settings))
    read = read_log(log)
    found = replay(read.frames, decoder)
    rows = []
    for (identifier, _), entry in sorted(found.regularity.items()):
        p99, worst = entry.jitter
        rejected = sum(entry.rejected.values())
        rows.append(
            {
                "identifier": f"0x{identifier:X}",
                "frames": len(entry.times),
                "period_ms": _rounded(1e3 * entry.period),
                "jitter_p99_ms": _rounded(1e3 * p99),
                "jitter_worst_ms": _rounded(1e3 * worst),
                "rejected": rejected,
                "counter_errors": entry.counter_errors,
            }
        )
    result: dict[str, Any] = {
        "log": str(log),
        "frames": len(read.frames),
        "seconds": _rounded(read.frames[-1].time),
        "torn": read.torn,
        "unknown": found.unknown,
        "identifiers": rows,
    }
    if campaign and motor is not None:
        written = write_campaign(out, read, make(motor, **settings), log.stem, manoeuvre)
        result["campaign"] = {"folder": str(out), "runs": [run._asdict() for run in written]}
    if mf4:
        result["mf4"] = [str(path) for path in as_mf4(out, log, dbc or dbc_of(str(motor)), campaign)]
    if as_json:
        print_json(result)
        return
    if not rows:
        click.echo(f"none of the {len(read.frames)} frames is one that this decoder knows")
    else:
        print_table(list(rows[0]), [list(row.values()) for row in rows])
    if read.torn and not quiet:
        click.echo("the log ends in the middle of a frame; all before it was read", err=True)
    for run in result.get("campaign", {}).get("runs", []):
        click.echo(f"{out / run['file']}  {run['seconds']:.1f} s")
    for written in result.get("mf4", []):
        click.echo(written)


def _rounded(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 4)
