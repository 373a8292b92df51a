"""From runs to records: what is held out, and which repeats are averaged.

The split is made before anything is fitted. Runs that were driven alike are averaged: their mean is what is fitted,
their deviations from it are the noise. Without a held-out run the later part of every slow manoeuvre is held out.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from identification.campaign import Run
from identification.frf import Floats
from identification.gap.model import Record

ALIKE = 0.05  # relative rms deviation of the led input up to which runs count as repeats
LENGTHS = 0.05  # relative difference in length up to which repeats are trimmed to the shortest
SETTLE_S = 1.5  # not judged: the state at the start of a log is not known
HELD_SHARE = 0.4  # of a run, where no whole run is held out


def records_of(runs: Sequence[Run], lead: str, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[Record, ...]:
    """Records of runs, ``lead`` being the channel by which repeats are known; roles as the runs say."""
    groups: dict[tuple[str, str, float, float], list[list[Run]]] = defaultdict(list)
    for run in runs:
        families = groups[run.role, run.manoeuvre, run.speed_kmh, round(run.dt, 9)]
        home = next((family for family in families if _alike(family[0], run, lead)), None)
        if home is None:
            families.append([run])
        else:
            home.append(run)
    records = [_record(family, inputs, outputs) for families in groups.values() for family in families]
    if all(record.role == "identify" for record in records):
        records = [part for record in records for part in _split(record)]
    return tuple(records)


def _alike(one: Run, other: Run, lead: str) -> bool:
    a, b = one.channels[lead], other.channels[lead]
    n = min(a.size, b.size)
    if n < (1.0 - LENGTHS) * max(a.size, b.size) or set(one.channels) != set(other.channels):
        return False
    deviation: Floats = a[:n] - b[:n]
    return float(np.std(deviation)) < ALIKE * max(float(np.std(a[:n])), 1e-12)


def _record(family: Sequence[Run], inputs: Sequence[str], outputs: Sequence[str]) -> Record:
    n = min(run.time.size for run in family)
    first = family[0]

    def mean(name: str) -> Floats:
        value: Floats = np.mean([run.channels[name][:n] for run in family], axis=0)
        return value

    measured = [name for name in outputs if name in first.channels]
    margin = min(round(SETTLE_S / first.dt), n // 5)
    return Record(
        name=first.name if len(family) == 1 else f"{first.name} and {len(family) - 1} more",
        manoeuvre=first.manoeuvre,
        group=first.speed_kmh,
        speed=_speed(family),
        dt=first.dt,
        inputs={name: mean(name) for name in inputs if name in first.channels},
        outputs={name: mean(name) for name in measured},
        keep=slice(margin, n - margin // 3),
        role=first.role,
        repeats=tuple({name: run.channels[name][:n] for name in measured} for run in family),
    )


def _speed(family: Sequence[Run]) -> float:
    channels = [run.channels["vehicle_speed_mps"] for run in family if "vehicle_speed_mps" in run.channels]
    return float(np.mean([channel.mean() for channel in channels])) if channels else family[0].speed


def _split(record: Record) -> list[Record]:
    """The record as fitted and, but for sweeps, its later part as held out."""
    from dataclasses import replace

    if record.manoeuvre == "frequency_response":
        return [record]
    start, stop = record.keep.start, record.keep.stop
    cut = stop - round(HELD_SHARE * (stop - start))
    return [
        replace(record, keep=slice(start, cut)),
        replace(record, keep=slice(cut, stop), role="validate", name=f"{record.name}, later part"),
    ]
