"""The wire: how long a frame takes, who goes first, and what does not fit.

Lengths follow ISO 11898-1 with the worst stuffing that the content could need, and three bits between frames. Nodes
send their own frames in order, and of the frames that wait the lowest identifier goes first (at equal leading bits the
11-bit form wins against the 29-bit one).
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from steer_env.rig.frame import Frame

QUEUE = 64  # frames that a node keeps waiting; more are refused
_GAP = 3


def frame_time(frame: Frame, bitrate: int, data_bitrate: int = 0) -> float:
    """Seconds that a frame occupies the wire, with worst stuffing and the gap; 0 for a bit rate of 0."""
    if bitrate <= 0:
        return 0.0
    if frame.fd:
        slow, fast = _fd_bits(frame)
        return slow / bitrate + fast / (data_bitrate or bitrate)
    return classic_bits(frame, stuffed=True) / bitrate


def classic_bits(frame: Frame, stuffed: bool) -> int:
    """Bits of a classic frame from start of frame to the gap, without stuff bits or with the most there can be."""
    data = 0 if frame.remote else 8 * len(frame.data)
    guarded = (54 if frame.extended else 34) + data  # start of frame to the end of the CRC
    return guarded + 10 + _GAP + ((guarded - 1) // 4 if stuffed else 0)


def _fd_bits(frame: Frame) -> tuple[int, int]:
    """Bits of an FD frame at the nominal and at the data bit rate, with worst stuffing."""
    head = 36 if frame.extended else 17  # start of frame to the bit rate switch
    short = len(frame.data) <= 16
    body = 5 + 8 * len(frame.data)  # error state, length, data
    checked = (4 + 17 + 6) if short else (4 + 21 + 7)  # stuff count, CRC and its fixed stuff bits
    return head + (head - 1) // 4 + 12 + _GAP, body + body // 4 + checked


def priority(frame: Frame) -> tuple[int, bool, int]:
    """Sorts frames as arbitration does: leading 11 bits, form, the rest."""
    if frame.extended:
        return frame.identifier >> 18, True, frame.identifier & 0x3FFFF
    return frame.identifier, False, 0


class Sent(NamedTuple):
    """A frame that has reached the other nodes: who sent it and when it was complete, in s."""

    node: str
    frame: Frame
    time: float


class Wire:
    """A bus with nodes by name. ``bitrate`` 0: frames take no time, in the order in which they are queued."""

    def __init__(self, bitrate: int, data_bitrate: int = 0) -> None:
        self.bitrate, self.data_bitrate = bitrate, data_bitrate
        self.busy = 0.0  # s of frames so far
        self.refused = 0
        self._waiting: dict[str, deque[Frame]] = {}
        self._current: tuple[str, Frame] | None = None
        self._free_at = 0.0

    def queue(self, node: str, frame: Frame, now: float) -> bool:
        """Let a node send; False where its queue is full."""
        waiting = self._waiting.setdefault(node, deque())
        if len(waiting) >= QUEUE:
            self.refused += 1
            return False
        waiting.append(frame)
        if self._current is None:
            self._arbitrate(max(now, self._free_at))
        return True

    def drop(self, node: str) -> None:
        """Forget what a node has waiting, as a controller does in bus-off."""
        self._waiting.pop(node, None)

    def due(self) -> float:
        """When the present frame is complete, in s."""
        return self._free_at if self._current is not None else math.inf

    def complete(self) -> Sent:
        """The frame that ``due`` told of; the next one starts."""
        assert self._current is not None
        node, frame = self._current
        sent = Sent(node, frame, self._free_at)
        self._current = None
        if any(self._waiting.values()):
            self._arbitrate(self._free_at)
        return sent

    def _arbitrate(self, now: float) -> None:
        heads = {node: frames[0] for node, frames in self._waiting.items() if frames}
        node = min(heads, key=lambda name: priority(heads[name]))
        frame = self._waiting[node].popleft()
        lasts = frame_time(frame, self.bitrate, self.data_bitrate)
        self.busy += lasts
        self._current, self._free_at = (node, frame), now + lasts
