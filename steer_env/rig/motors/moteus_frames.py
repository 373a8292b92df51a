"""Register subframes of moteus, for both ends of the bus: no DBC can describe frames that describe themselves.

A subframe is a byte (what, type and, in its two low bits, the count; count 0: the count follows), a start register and,
for writes and replies, the values, least significant byte first. 0x50 pads.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

WRITE, READ, REPLY = 0x00, 0x10, 0x20
INT8, FLOAT = 0x00, 0x0C
NOP = 0x50
MODE, POSITION, FAULT = 0x000, 0x001, 0x00F
COMMAND, TORQUE, KP_SCALE, KD_SCALE, MAX_TORQUE, WATCHDOG, ILIMIT_SCALE = (
    0x020,
    0x022,
    0x023,
    0x024,
    0x025,
    0x027,
    0x02B,
)
STOPPED, FAULTED, POSITION_MODE, TIMEOUT = 0, 1, 10, 11
SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # bytes that a CAN FD frame can have
_FORMATS = {0x00: "b", 0x04: "h", 0x08: "i", 0x0C: "f"}
QUERY = bytes([READ | INT8 | 1, MODE, READ | FLOAT | 3, POSITION, READ | INT8 | 1, FAULT])
_REPLY = struct.Struct("<BBbBBfffBBb")


class Report(NamedTuple):
    """What QUERY asks for: mode, turns, turns per s, N m and fault code."""

    mode: int
    position: float
    velocity: float
    torque: float
    fault: int


class Registers(NamedTuple):
    """What a frame writes (register -> value) and which registers it reads (register, type)."""

    writes: dict[int, float]
    reads: tuple[tuple[int, int], ...]


def stop_command() -> bytes:
    """Mode "stopped", which also clears faults, and the query."""
    return padded(bytes([WRITE | INT8 | 1, MODE, STOPPED]) + QUERY)


def torque_command(torque: float, max_torque: float, watchdog_s: float) -> bytes:
    """Position mode without position: kp, kd and integral scaled to zero, a torque in N m fed forward; and the query.

    ``watchdog_s`` 0: the drive's own default. The largest torque has a subframe of its own: a header that is damaged
    spoils either the torque or its limit.
    """
    command = struct.pack("<5f", float("nan"), 0.0, torque, 0.0, 0.0)
    return padded(
        bytes([WRITE | INT8 | 1, MODE, POSITION_MODE, WRITE | FLOAT, 5, COMMAND])
        + command
        + struct.pack("<BBf", WRITE | FLOAT | 1, MAX_TORQUE, max_torque)
        + struct.pack("<BBfBBf", WRITE | FLOAT | 1, WATCHDOG, watchdog_s, WRITE | FLOAT | 1, ILIMIT_SCALE, 0.0)
        + QUERY
    )


def query_command() -> bytes:
    """The query alone."""
    return padded(QUERY)


def report_data(report: Report) -> bytes:
    """The drive's answer to QUERY."""
    mode, position, velocity, torque, fault = report
    return padded(
        _REPLY.pack(
            REPLY | INT8 | 1, MODE, mode, REPLY | FLOAT | 3, POSITION, position, velocity, torque,
            REPLY | INT8 | 1, FAULT, fault,
        )
    )  # fmt: skip


def report_of(data: bytes) -> Report | None:
    """The answer to QUERY; None for anything else than exactly that, padded."""
    if len(data) < _REPLY.size or any(byte != NOP for byte in data[_REPLY.size :]):
        return None
    fields = _REPLY.unpack_from(data)
    if fields[0:2] != (0x21, MODE) or fields[3:5] != (0x2F, POSITION) or fields[8:10] != (0x21, FAULT):
        return None
    return Report(fields[2], fields[5], fields[6], fields[7], fields[10])


def registers_of(data: bytes) -> Registers | None:
    """What a host's frame writes and reads, in the registers' raw units; None where it cannot be parsed."""
    writes: dict[int, float] = {}
    reads: list[tuple[int, int]] = []
    at = 0
    try:
        while at < len(data):
            head = data[at]
            at += 1
            if head == NOP:
                continue
            what, kind, count = head & 0xF0, head & 0x0C, head & 0x03
            if what not in (WRITE, READ):
                return None
            if count == 0:
                count, at = data[at], at + 1
            start, at = data[at], at + 1
            if max(count, start) > 0x7F:
                return None  # longer numbers than any register here needs
            if what == READ:
                reads += [(start + k, kind) for k in range(count)]
                continue
            form = struct.Struct("<" + _FORMATS[kind] * count)
            values = form.unpack_from(data, at)
            at += form.size
            writes.update({start + k: float(value) for k, value in enumerate(values)})
    except (IndexError, struct.error):
        return None
    return Registers(writes, tuple(reads))


def padded(data: bytes) -> bytes:
    """Data filled up to a length that CAN FD has."""
    size = next(size for size in SIZES if size >= len(data))
    return data + bytes([NOP]) * (size - len(data))
