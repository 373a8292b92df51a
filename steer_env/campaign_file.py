"""A measurement campaign that is being written: campaign.toml and a CSV file per run (docs/formats.md, section 1).

    with CampaignFile(folder, "a name", "rig") as campaign:
        campaign.begin(("time_s", "motor_angle_rad", "motor_torque_Nm"), "torque_sweep")
        campaign.row((0.0, 0.1, 0.2))
        campaign.end()

It can be read at any time in between: rows reach the file in whole lines, ``FLUSH`` of them at once, and a run is
listed in campaign.toml as soon as it is long enough to be read. A killed program therefore loses ``FLUSH`` rows at
most, a tenth of a second at 1 kHz. Nothing is synced to the disk while a run lasts, since that may take longer than a
control period; after a power failure it depends on the disk.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from steer_env.errors import InputError

SCHEMA_VERSION = 1
FLUSH = 100  # rows that are written at once
# Shortest useful run of each manoeuvre in s, and why.
SHORTEST: dict[str, tuple[float, str]] = {
    "frequency_response": (10.0, "steps I and II need at least four lines between 0.2 and 0.5 Hz"),
    "steady_state": (10.0, "two periods of 0.2 Hz: one to settle, one to read the loop from"),
    "constant_speed_cornering": (5.0, "the wheel must be turned slowly enough to be quasi-static"),
    "on_centre_weave": (10.0, "two periods of 0.2 Hz: one to settle, one to read the loop from"),
    "step_steer": (2.0, "the yaw response must settle"),
    "release": (2.0, "the free oscillation must decay"),
    "standstill": (5.0, "the wheel must be turned there and back"),
    "torque_sweep": (5.0, "the sweep must reach low frequencies"),
    "free": (5.0, "a few movements of the wheel must be in it"),
}
ANYTHING = "free"  # what a run counts as that is too short for its manoeuvre, or whose manoeuvre has no name here


class RunEntry(NamedTuple):
    """A run as campaign.toml lists it; ``speed_kmh`` None where the kind has none."""

    file: str
    manoeuvre: str
    speed_kmh: float | None = None
    role: str = "auto"


def toml_text(name: str, kind: str, tables: Mapping[str, Mapping[str, float]], runs: Sequence[RunEntry]) -> str:
    """Text of campaign.toml."""
    lines = [f"schema_version = {SCHEMA_VERSION}", f"name = {json.dumps(name)}", f'kind = "{kind}"']
    for table, values in tables.items():
        lines += ["", f"[{table}]", *(f"{key} = {value!r}" for key, value in values.items())]
    for run in runs:
        lines += ["", "[[runs]]", f'file = "{run.file}"', f'manoeuvre = "{run.manoeuvre}"']
        if run.speed_kmh is not None:
            lines.append(f"speed_kmh = {run.speed_kmh!r}")
        lines.append(f'role = "{run.role}"')
    return "\n".join(lines) + "\n"


def csv_text(columns: Mapping[str, Any]) -> str:
    """Text of a run's CSV file with a header; ``columns`` each [n]."""
    text = io.StringIO()
    formats = [_format(name) for name in columns]
    table = np.column_stack(list(columns.values()))
    np.savetxt(text, table, fmt=formats, delimiter=",", header=",".join(columns), comments="")
    return text.getvalue()


def refuse_recorded(folder: Path) -> None:
    """Raise InputError if a campaign, or runs of one, are in a folder."""
    for found in (folder / "campaign.toml", *(folder / "runs").glob("*.csv")):
        if found.exists():
            raise InputError(f"{found}", "is there already", "choose another folder, or move it away")


class CampaignFile:
    """Writes FOLDER/campaign.toml and FOLDER/runs/*.csv; InputError if a campaign is there already.

    ``tables`` are [vehicle] and [steering], or [rig]. ``listed`` are the runs that campaign.toml names so far,
    ``too_short`` the files that are too short for it to name.
    """

    def __init__(
        self, folder: str | Path, name: str, kind: str, tables: Mapping[str, Mapping[str, float]] | None = None
    ) -> None:
        self.folder, self.name, self.kind = Path(folder), name, kind
        self.path = self.folder / "campaign.toml"
        refuse_recorded(self.folder)
        (self.folder / "runs").mkdir(parents=True, exist_ok=True)
        self.tables = dict(tables or {})
        self.listed: list[RunEntry] = []
        self.too_short: list[str] = []
        self._runs = 0
        self._file: io.RawIOBase | None = None

    def begin(
        self, columns: Sequence[str], manoeuvre: str, speed_kmh: float | None = None, role: str = "auto"
    ) -> None:
        """Start a run's file, ending the one before; the first column is time_s."""
        self.end()
        self._runs += 1
        self._wish = manoeuvre if manoeuvre in SHORTEST else ANYTHING
        self._speed_kmh, self._role = speed_kmh, role
        at_speed = "" if speed_kmh is None else f"{speed_kmh:03.0f}_"
        self._run = f"runs/{at_speed}{manoeuvre}_{self._runs}.csv"
        self._file = (self.folder / self._run).open("xb", buffering=0)
        self._format = ",".join(_format(name) for name in columns) + "\n"
        self._lines = [",".join(columns) + "\n"]
        self._first: float | None = None
        self._last = 0.0
        self._as: str | None = None  # what campaign.toml lists the run as

    def row(self, values: Sequence[float]) -> None:
        """Add a sample; its time in s is above the last one's."""
        self._last = values[0]
        if self._first is None:
            self._first = values[0]
        self._lines.append(self._format % tuple(values))
        if len(self._lines) >= FLUSH:
            self._write()

    def end(self) -> None:
        """Finish the run, if one is open."""
        if self._file is None:
            return
        self._write()
        self._file.close()
        self._file = None
        if self._as is None:
            self.too_short.append(self._run)

    def close(self) -> None:
        """Finish the campaign."""
        self.end()

    def __enter__(self) -> CampaignFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self) -> None:
        """Let the lines go as one write, and list the run once they make it long enough."""
        assert self._file is not None
        content = memoryview("".join(self._lines).encode("ascii"))
        self._lines = []
        while content:  # a raw file may take less than it is given; a full disk raises
            content = content[self._file.write(content) or 0 :]
        seconds = self._last - (self._first or 0.0)
        fitting = next((name for name in (self._wish, ANYTHING) if seconds >= SHORTEST[name][0]), None)
        if fitting is not None and fitting != self._as:
            entry = RunEntry(self._run, fitting, self._speed_kmh, self._role)
            self.listed = [run for run in self.listed if run.file != self._run] + [entry]
            self._as = fitting
            self._write_toml()

    def _write_toml(self) -> None:
        """As ``atomic.write_text``, but without waiting for the disk."""
        beside = self.folder / ".campaign.toml.partial"
        beside.write_bytes(toml_text(self.name, self.kind, self.tables, self.listed).encode("utf-8"))
        os.replace(beside, self.path)


def _format(column: str) -> str:
    return "%.6f" if column == "time_s" else "%.9g"
