"""A log of CAN frames, read back: whatever python-can reads, and a file that was cut off in the middle."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import NamedTuple

from steer_env.errors import InputError
from steer_env.rig.bus import frame_of
from steer_env.rig.frame import Frame

BLF_HEADER = 144  # bytes
SUFFIXES = (".blf", ".log", ".asc", ".csv", ".trc", ".mf4")


class Logged(NamedTuple):
    """A frame of a log: time in s from the first one, whether the logger sent it, and its channel."""

    time: float
    frame: Frame
    sent: bool
    channel: str


class Log(NamedTuple):
    """Frames by time, whether the file ended in the middle of one, and the first one's time stamp (Unix time in s)."""

    frames: list[Logged]
    torn: bool
    start: float = 0.0


def read_log(path: str | Path) -> Log:
    """Read a log by its file ending; raises InputError where it is none, or has no frames."""
    path = Path(path)
    try:
        import can
    except ImportError:
        raise InputError(f"{path}", "python-can is not installed", "pip install 'steer-env[rig]'") from None
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}", "is no kind of log known here", f"give a file that ends in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}", "is not there", "give the path of a log")
    # python-can's reader leaves a file open that it does not understand.
    with path.open("rb") as file:
        head = file.read(BLF_HEADER)
    if path.suffix.lower() == ".blf" and (len(head) < BLF_HEADER or not head.startswith(b"LOGG")):
        raise InputError(f"{path}", "cannot be read (it does not begin as a BLF file)", "check what kind of log it is")
    frames: list[Logged] = []
    torn = False
    try:
        with can.LogReader(path) as reader:
            # A BLF file tells its own size when it was finished; the reader passes over what is missing.
            torn = getattr(reader, "file_size", path.stat().st_size) != path.stat().st_size
            for message in reader:
                if not message.is_error_frame:
                    name = "" if message.channel is None else str(message.channel)
                    frames.append(Logged(message.timestamp, frame_of(message), not message.is_rx, name))
    except (struct.error, zlib.error, ValueError, IndexError, can.io.blf.BLFParseError) as error:
        if not frames:
            raise InputError(f"{path}", f"cannot be read ({error})", "check that it is a log of this kind") from error
        torn = True
    except ImportError as error:
        raise InputError(f"{path}", str(error), "pip install 'steer-env[formats]'") from error
    if path.suffix.lower() == ".log" and frames and not path.read_bytes().endswith(b"\n"):
        frames.pop()  # a line that was cut may still read as a frame, with fewer bytes
        torn = True
    if not frames:
        raise InputError(f"{path}", "has no frames", "give a log of a bus that was alive")
    frames.sort(key=lambda logged: logged.time)
    first = frames[0].time
    return Log([logged._replace(time=logged.time - first) for logged in frames], torn, max(first, 0.0))
