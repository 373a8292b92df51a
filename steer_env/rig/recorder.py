"""A recorder of raw CAN: every frame, ours and theirs, as BLF and as a candump log, written as it comes.

    with Recorder(folder) as recorder:
        ...                               # tap=recorder.frame, or recorder.frame(frame, time, sent)

Whatever ends the program, a kill included, costs less than the last second: the candump log is written line by line,
the BLF file a few frames at a time, both unbuffered, and ``log_file.read_log`` reads a file that ends in the middle.
After a power failure it depends on the disk.
"""

from __future__ import annotations

import time
from pathlib import Path
from types import TracebackType
from typing import Any

from steer_env.errors import InputError
from steer_env.rig.bus import message_of
from steer_env.rig.frame import Frame

CONTAINER = 512  # bytes of a BLF container: about eight frames
SUFFIXES = ("blf", "log")


class Recorder:
    """Writes FOLDER/NAME.blf and NAME.log; raises InputError if one of them is there already.

    A recorder that was given no frame leaves no file.
    """

    def __init__(self, folder: str | Path, name: str = "rig", suffixes: tuple[str, ...] = SUFFIXES) -> None:
        import can

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.paths = [folder / f"{name}.{suffix}" for suffix in suffixes]
        for path in self.paths:
            if path.suffix.lstrip(".") not in SUFFIXES:
                raise InputError(f"{path}", "cannot be written frame by frame", f"choose from {', '.join(SUFFIXES)}")
            if path.exists():
                raise InputError(f"{path}", "is there already", "choose another folder or name, or move it away")
        self.frames = 0
        self._wall = time.time()  # what a log's time stamps count from
        self._start: float | None = None
        self._writers: list[Any] = []
        for path in self.paths:
            if path.suffix == ".blf":
                raw = path.open("wb+", buffering=0)
                self._writers.append(can.BLFWriter(raw, compression_level=0, max_container_size=CONTAINER))
            else:
                text = path.open("w", buffering=1, encoding="utf-8", newline="\n")
                self._writers.append(can.CanutilsLogWriter(text, channel="rig"))

    def frame(self, frame: Frame, host_time: float, sent: bool) -> None:
        """Write one frame; ``host_time`` in s on any clock that does not jump, ``sent``: by us."""
        if self._start is None:
            self._start = host_time
        message = message_of(frame)
        message.timestamp = self._wall + (host_time - self._start)
        message.is_rx = not sent
        for writer in self._writers:
            writer.on_message_received(message)
        self.frames += 1

    def close(self) -> None:
        """Finish the files."""
        for writer in self._writers:
            writer.stop()
        self._writers = []
        if not self.frames:
            for path in self.paths:
                path.unlink(missing_ok=True)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
