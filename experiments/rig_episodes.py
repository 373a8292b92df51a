"""Episodes on a rig, recorded: every frame as BLF and candump, the signals as a campaign, and how well time was kept.

``rig run`` and ``rig excite`` share it. Nothing here may hold up a control cycle: no thread draws a progress bar, and
MF4, which is only whole when it is finished, is made of the logs afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from experiments.cli_options import print_json, print_table
from steer_env import atomic
from steer_env.errors import RigError

# Trips that come of a computer that did not run us in time.
LATE = (
    "the measurement is stale",
    "too many control cycles came late",
    "a control cycle came much too late",
    "the watchdog has dropped the drive",
)
BUSY = (
    "Unless the motor fell silent, this computer does not keep the pace of 1 ms: end other programs, or measure it by "
    "'python -m experiments.rig_timing'. A virtual motor bears more: --patience 10."
)
COMPLETE = "end of the manoeuvre"


class Played(NamedTuple):
    """An episode: why it ended, rms tracking error (N m or rad), lateness [n] in s, periods skipped, signals [n, m]."""

    ended: str
    rms_error: float
    late: np.ndarray
    overruns: int
    signals: np.ndarray


class Recorded(NamedTuple):
    """An environment that is recorded, and the paths of its logs and its campaign."""

    env: Any
    logs: tuple[Path, ...]
    campaign: Path


@contextmanager
def recorded(out: Path, options: dict[str, Any], causality: str, kind: str, mf4: bool) -> Iterator[Recorded]:
    """Hand out a rig that writes its frames and a campaign to ``out``; torque off and files whole at the end.

    ``options`` are those of ``RigEnv``. Raises InputError where ``out`` holds a recording, before a bus is opened.
    """
    import gymnasium

    import steer_env.rig.rig_env  # noqa: F401  (loaded before a motor waits)
    from steer_env.campaign_mf4 import require_asammdf
    from steer_env.envs import RecordCampaign
    from steer_env.rig.mf4 import as_mf4
    from steer_env.rig.motors.dbc import dbc_of
    from steer_env.rig.recorder import Recorder

    if mf4:
        require_asammdf("--mf4")
    with Recorder(out) as recorder:
        rig = gymnasium.make(f"steer_env/Rig-{causality.capitalize()}-v0", tap=recorder.frame, **options)
        name = f"{options['motor']} on {options['interface']}"
        with RecordCampaign(rig, out, kind=kind, name=name) as env:
            yield Recorded(env, tuple(recorder.paths), out / "campaign.toml")
    if mf4:
        as_mf4(out, recorder.paths[0], dbc_of(options["motor"]), campaign=True)


def play(env: Any, law: Any, seed: int, label: str, quiet: bool) -> Played:
    """One episode of a controller, from the reset to its end."""
    from steer_env.envs.layout import Truth

    inside: Any = env.unwrapped
    rows, late = [], []
    try:
        _, info = env.reset(seed=seed)
    except RigError as refused:
        if any(reason in str(refused) for reason in LATE):
            raise RigError(f"{refused}. {BUSY}") from refused
        raise
    law.reset(inside.session.pacer.period)
    while not info["ended"]:
        torque = law(info["observation"])
        if not math.isfinite(torque):
            raise RigError(f"the controller asks for {torque} N m after {info['time']:g} s, which is no torque")
        *_, info = env.step(inside.action_for(torque))
        rows.append([info[name] for name in Truth._fields])
        late.append(info["rig"]["late"])
        if not quiet and len(rows) % 1000 == 0:
            click.echo(f"\r{label}  {len(rows) // 1000:4d} s of {inside.periods // 1000}", nl=False, err=True)
    if not quiet:
        click.echo(f"\r{label}  {info['ended']}{' ' * 20}", err=True)
    signals = np.array(rows)
    error = signals[:, Truth._fields.index("error")]
    overruns = info["rig"]["overruns"]
    return Played(info["ended"], float(np.sqrt(np.mean(error * error))), np.array(late), overruns, signals)


def write_signals(path: Path, played: Played) -> None:
    """What ``info`` said in each period (fields of ``Truth``, SI), reference and error among it."""
    from steer_env.envs.layout import Truth

    lines = [",".join(Truth._fields), *(",".join(f"{value:.9g}" for value in row) for row in played.signals)]
    atomic.write_text(path, "\n".join(lines) + "\n")


def report(ctx: click.Context, played: Sequence[Played], rig: Recorded, as_json: bool) -> None:
    """Print what came of the episodes; exit status 1 where one tripped."""
    late = 1e3 * np.concatenate([episode.late for episode in played])
    tripped = [episode.ended for episode in played if episode.ended != COMPLETE]
    listed = rig.env.campaign.listed
    result = {
        "ended": tripped[0] if tripped else COMPLETE,
        "episodes": len(played),
        "seconds": round(1e-3 * late.size, 3),
        "rms_error": float(np.sqrt(np.mean([episode.rms_error**2 for episode in played]))),
        "late_p50_ms": float(np.median(late)),
        "late_p99_ms": float(np.percentile(late, 99)),
        "overruns": sum(episode.overruns for episode in played),
    }
    files = {"log": str(rig.logs[0]), "campaign": str(rig.campaign) if listed else ""}
    if as_json:
        print_json({**result, **files, "runs": len(listed)})
    else:
        print_table(list(result), [list(result.values())])
        click.echo(files["log"])
        said = f"{rig.campaign}  {len(listed)} runs" if listed else "no campaign: no run lasted long enough for one"
        click.echo(said)
    if tripped:
        if tripped[0].removeprefix("tripped: ") in LATE:
            click.echo(BUSY, err=True)
        ctx.exit(1)
