"""Logs of CAN frames as MF4 in the bus-logging form of ASAM MDF 4.1, which CAN tools open and decode.

MF4 is whole only when it is finished: a log is recorded as BLF and candump, and converted afterwards. ``Dir`` is 1 for
frames that we sent. The motor's .dbc, where there is one, is attached.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env import atomic
from steer_env.campaign_mf4 import VERSION, campaign_as_mf4, require_asammdf
from steer_env.rig.log_file import Log, Logged, read_log

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # bytes by DLC, ISO 11898-1
_FIELDS = (("BusChannel", "<u1"), ("ID", "<u4"), ("IDE", "<u1"), ("DLC", "<u1"), ("DataLength", "<u1"))
_DATA = (("DataBytes", "(64,)u1"), ("Dir", "<u1"), ("EDL", "<u1"), ("BRS", "<u1"))
_REMOTE = (("Dir", "<u1"),)


def as_mf4(out: Path, log: Path, dbc: Path | None = None, campaign: bool = False) -> list[Path]:
    """Write OUT/mf4: a log's frames and, with ``campaign``, the runs of the one in OUT, if any. Returns the files."""
    require_asammdf(f"{out / 'mf4'}")
    with atomic.folder(out / "mf4") as staging:
        write_frames(staging / f"{log.stem}.mf4", read_log(log), dbc)
        if campaign:
            campaign_as_mf4(out, staging)
    return sorted((out / "mf4").rglob("*.mf4"))


def write_frames(path: Path, log: Log, dbc: Path | None = None) -> None:
    """Write the frames of a log; times count from its first frame, whose date is the file's."""
    asammdf = require_asammdf(f"{path}")
    from asammdf.blocks.v4_blocks import SourceInformation
    from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

    source = SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN)
    attachment = None if dbc is None else (dbc.read_bytes(), dbc.name, None)
    channels = {name: k for k, name in enumerate(sorted({logged.channel for logged in log.frames}), 1)}
    with asammdf.MDF(version=VERSION) as mdf:
        mdf.header.start_time = datetime.fromtimestamp(log.start, UTC)
        for name, remote in (("CAN_DataFrame", False), ("CAN_RemoteFrame", True)):
            frames = [logged for logged in log.frames if logged.frame.remote == remote]
            if frames:
                mdf.append(
                    asammdf.Signal(
                        name=name,
                        samples=_records(frames, name, channels),
                        timestamps=np.array([logged.time for logged in frames]),
                        source=source,
                        attachment=attachment,
                    )
                )
        mdf.save(path, overwrite=True, compression=1)


def _records(frames: list[Logged], name: str, channels: dict[str, int]) -> NDArray[Any]:
    """Frames as the records of a CAN_DataFrame or CAN_RemoteFrame group."""
    remote = frames[0].frame.remote
    fields = [(f"{name}.{field}", kind) for field, kind in (*_FIELDS, *(_REMOTE if remote else _DATA))]
    records = np.zeros(len(frames), dtype=fields)
    for k, (_, frame, sent, channel) in enumerate(frames):
        row, size = records[k], len(frame.data)
        row[f"{name}.BusChannel"], row[f"{name}.ID"] = channels[channel], frame.identifier
        row[f"{name}.IDE"], row[f"{name}.Dir"] = frame.extended, sent
        row[f"{name}.DLC"], row[f"{name}.DataLength"] = FD_LENGTHS.index(size), size
        if not remote:
            row[f"{name}.DataBytes"][:size] = np.frombuffer(frame.data, np.uint8)
            row[f"{name}.EDL"] = row[f"{name}.BRS"] = frame.fd
    return records
