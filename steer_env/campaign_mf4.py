"""The runs of a campaign as MF4 (ASAM MDF 4.10): channels of the campaign's names in SI with their units.

An MF4 file is whole only when it is finished, so runs are recorded as CSV and converted afterwards.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from steer_env.campaign_file import ANYTHING, RunEntry, toml_text
from steer_env.errors import InputError

# What a column's name ends in, and the unit that it stands for.
UNITS = {"s": "s", "rad": "rad", "radps": "rad/s", "Nm": "Nm", "N": "N", "mps": "m/s", "mps2": "m/s^2"}
VERSION = "4.10"


def require_asammdf(where: str) -> Any:
    """The package asammdf; InputError where it is not installed. ``where`` asked for it."""
    try:
        import asammdf
    except ImportError:
        raise InputError(where, "asammdf is not installed", "pip install 'steer-env[formats]'") from None
    return asammdf


def campaign_as_mf4(folder: Path, target: Path) -> list[Path]:
    """Write ``target``/campaign.toml and its runs as MF4 of a campaign of CSV files, as ``CampaignFile`` writes them.

    Returns the files of the runs; none, and nothing is written, where ``folder`` has no campaign.
    """
    asammdf = require_asammdf(f"{target}")
    if not (folder / "campaign.toml").exists():
        return []
    declared = tomllib.loads((folder / "campaign.toml").read_text("utf-8"))
    entries, written = [], []
    (target / "runs").mkdir(parents=True, exist_ok=True)
    for run in declared["runs"]:
        file = str(Path(run["file"]).with_suffix(".mf4").as_posix())
        _write_run(asammdf, folder / run["file"], target / file, declared["name"])
        entries.append(RunEntry(file, run.get("manoeuvre", ANYTHING), run.get("speed_kmh"), run.get("role", "auto")))
        written.append(target / file)
    tables: dict[str, Any] = {name: declared[name] for name in ("vehicle", "steering", "rig") if name in declared}
    text = toml_text(declared["name"], declared["kind"], tables, entries)
    (target / "campaign.toml").write_text(text, encoding="utf-8", newline="\n")
    return written


def _write_run(asammdf: Any, source: Path, path: Path, comment: str) -> None:
    with source.open(encoding="ascii") as file:
        names = file.readline().strip().split(",")
        table = np.loadtxt(file, delimiter=",", ndmin=2)
    time = table[:, names.index("time_s")]
    signals = [
        asammdf.Signal(samples=table[:, k], timestamps=time, name=name, unit=UNITS[name.rpartition("_")[2]])
        for k, name in enumerate(names)
        if name != "time_s"
    ]
    with asammdf.MDF(version=VERSION) as mdf:
        mdf.append(signals, comment=comment, common_timebase=True)
        mdf.save(path, overwrite=True, compression=1)
