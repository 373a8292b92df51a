"""Set a CiA 402 drive up for ``cia402.py``: PDO map, mode, heartbeat, over SDO by the canopen library.

It is done once before a run, while the node is pre-operational and so cannot be enabled. It sends no torque. The map is
not stored in the drive: it is gone after a power cycle.
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from steer_env.errors import InputError
from steer_env.rig.bus import Bus
from steer_env.rig.motors.cia402 import CYCLIC_SYNCHRONOUS_TORQUE

HEARTBEAT_ms = 50
_DISABLED, _NO_REMOTE = 0x8000_0000, 0x4000_0000
_EVERY_SYNC = 1
_RATED_TORQUE, _SUPPORTED_MODES, _MODE, _MAX_TORQUE, _TORQUE_OFFSET = 0x6076, 0x6502, 0x6060, 0x6072, 0x60B2
_CST_BIT = 9
# Communication object, map object, COB-ID base, mapped objects (index, sub-index, bits) of cia402.dbc.
PDOS: tuple[tuple[int, int, int, tuple[int, ...]], ...] = (
    (0x1400, 0x1600, 0x200, (0x6040_00_10, 0x6071_00_10, 0x6060_00_08)),
    (0x1800, 0x1A00, 0x180, (0x6041_00_10, 0x6064_00_20, 0x6077_00_10)),
    (0x1801, 0x1A01, 0x280, (0x606C_00_20, 0x6061_00_08)),
)


class Write(NamedTuple):
    """One value for an object; ``form`` is its struct format."""

    address: int
    sub: int
    value: int
    form: str


class Found(NamedTuple):
    """What the drive told: object 0x6076 as it is (mN m by the profile, a current with some makers)."""

    rated_raw: int
    rated_as_mNm: float  # N m, if it is mN m
    writes: int


def writes_for(node: int, max_torque_share: float) -> list[Write]:
    """Everything that is written, in order: a PDO is disabled, mapped, and enabled again."""
    writes = []
    for communication, mapping, base, entries in PDOS:
        identifier = base + node | (_NO_REMOTE if base != 0x200 else 0)
        writes.append(Write(communication, 1, identifier | _DISABLED, "<I"))
        writes.append(Write(communication, 2, _EVERY_SYNC, "<B"))
        writes.append(Write(mapping, 0, 0, "<B"))
        writes += [Write(mapping, k, entry, "<I") for k, entry in enumerate(entries, 1)]
        writes.append(Write(mapping, 0, len(entries), "<B"))
        writes.append(Write(communication, 1, identifier, "<I"))
    writes.append(Write(0x1017, 0, HEARTBEAT_ms, "<H"))
    writes.append(Write(_MODE, 0, CYCLIC_SYNCHRONOUS_TORQUE, "<b"))
    writes.append(Write(_MAX_TORQUE, 0, round(1000.0 * max_torque_share), "<H"))
    writes.append(Write(_TORQUE_OFFSET, 0, 0, "<h"))
    return writes


def configure(bus: Bus, node: int, max_torque_share: float = 1.0, timeout: float = 0.5) -> Found:
    """Write the map and read it back; raises InputError where the drive refuses, is silent or has no such mode.

    ``max_torque_share`` of the rated torque becomes the drive's own limit (0x6072). The bus is closed at the end.
    """
    try:
        import canopen
    except ImportError:
        raise InputError("cia402", "the canopen library is not installed", "pip install 'steer-env[rig]'") from None
    if not 0.0 < max_torque_share <= 1.0:
        raise InputError("cia402", f"max_torque_share is {max_torque_share}", "give a share above 0 and up to 1")
    where = f"CANopen node {node}"
    network = canopen.Network(bus.python_can)
    try:
        network.connect()
        drive = network.add_node(node, canopen.ObjectDictionary())
        drive.sdo.RESPONSE_TIMEOUT = timeout
        drive.nmt.state = "PRE-OPERATIONAL"
        (modes,) = struct.unpack("<I", drive.sdo.upload(_SUPPORTED_MODES, 0))
        if not modes >> _CST_BIT & 1:
            raise InputError(
                where, f"does not support cyclic synchronous torque (0x6502 is 0x{modes:08X})", "use another"
            )
        (rated,) = struct.unpack("<I", drive.sdo.upload(_RATED_TORQUE, 0))
        writes = writes_for(node, max_torque_share)
        for write in writes:
            _write(drive, write, where)
        return Found(rated, 1e-3 * rated, len(writes))
    except canopen.SdoAbortedError as error:
        raise InputError(where, f"refused ({error})", "check with the maker which objects can be mapped") from error
    except canopen.SdoCommunicationError as error:
        raise InputError(where, f"does not answer ({error})", "check node, bit rate, wiring and supply") from error
    finally:
        network.disconnect()


def _write(drive: Any, write: Write, where: str) -> None:
    data = struct.pack(write.form, write.value)
    drive.sdo.download(write.address, write.sub, data)
    found = bytes(drive.sdo.upload(write.address, write.sub))
    if found != data:
        raise InputError(
            where,
            f"object 0x{write.address:04X}:{write.sub} holds {found.hex()} after {data.hex()} was written",
            "check with the maker which objects can be mapped",
        )
