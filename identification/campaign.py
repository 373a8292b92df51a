"""Measurement campaigns: what was driven, read and checked (docs/formats.md, section 1).

``read_campaign`` returns runs in SI on an even time axis, or raises ``InputError`` with one message
that names the file, the row or key, what is wrong, and the mend. Nothing is guessed: whatever was
done to the data (resampling, a role given by the reader) stands in ``Run.notes`` or ``Run.role``.

Roles: a run with role "auto" becomes "identify"; where a manoeuvre was driven three times or more
at one speed, all of them "auto", the last repeat becomes "validate" and is held out of the fits.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

from identification.campaign_run import Run, read_run, require
from identification.campaign_table import open_table, sha256
from identification.campaign_toml import Declaration, KnownRig, KnownSteering, read_declaration
from steer_env.errors import InputError
from steer_env.plants.checked import suggestion
from steer_env.plants.reference_row import KnownVehicle

__all__ = [
    "Campaign",
    "KnownRig",
    "KnownSteering",
    "KnownVehicle",
    "Run",
    "read_campaign",
    "require",
]

REPEATS_FOR_VALIDATION = 3


@dataclass(frozen=True)
class Campaign:
    """A measurement campaign; ``hashes``: SHA-256 of each file, by name."""

    name: str
    kind: str
    vehicle: KnownVehicle | None
    steering: KnownSteering | None
    rig: KnownRig | None
    runs: list[Run]
    hashes: dict[str, str]
    folder: Path

    def select(self, manoeuvre: str, role: str = "identify") -> dict[float, list[Run]]:
        """Return the runs of one manoeuvre and role by speed in km/h, ascending."""
        found: dict[float, list[Run]] = defaultdict(list)
        for run in self.runs:
            if (run.manoeuvre, run.role) == (manoeuvre, role):
                found[run.speed_kmh].append(run)
        return dict(sorted(found.items()))


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign from its folder or its campaign.toml."""
    declared = read_declaration(path)
    runs = [read_run(entry, declared) for entry in declared.runs]
    _refuse_unused_maps(declared, runs)
    files = {declared.path.name: declared.path, **{r.file: r.path for r in declared.runs}}
    return Campaign(
        declared.name,
        declared.kind,
        declared.vehicle,
        declared.steering,
        declared.rig,
        _with_roles(runs, declared),
        {name: sha256(file) for name, file in files.items()},
        declared.path.parent,
    )


def _refuse_unused_maps(declared: Declaration, runs: list[Run]) -> None:
    """A mapped column that no run has is a typing error, not a missing measurement."""
    for name, entry in declared.maps.items():
        if name != "time_s" and not any(name in run.channels for run in runs):
            header = open_table(declared.runs[0].path).header
            raise InputError(
                f"{declared.path}: [channels] key '{name}'",
                f"no run has the column '{entry.source}'",
                suggestion(entry.source, header),
            )


def _with_roles(runs: list[Run], declared: Declaration) -> list[Run]:
    groups: dict[tuple[float, str], list[int]] = defaultdict(list)
    for index, run in enumerate(runs):
        groups[run.speed_kmh, run.manoeuvre].append(index)
    held_out = {
        members[-1]
        for members in groups.values()
        if len(members) >= REPEATS_FOR_VALIDATION and all(runs[i].role == "auto" for i in members)
    }
    result = [
        replace(run, role="validate" if index in held_out else "identify")
        if run.role == "auto"
        else run
        for index, run in enumerate(runs)
    ]
    if all(run.role == "validate" for run in result):
        raise InputError(
            f"{declared.path}: key 'role'",
            "every run is for validation",
            'give at least one run role = "identify"',
        )
    return result
