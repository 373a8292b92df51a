"""What a frame of each drive may be taken for, written once more from the published layouts and without our codecs.

Each oracle takes a frame from node 1 (0 where there are no nodes) and returns what must come out of a decoder, or None
where nothing may be believed. It shares no code with ``steer_env.rig.motors``: that is its worth.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, NamedTuple

TURN = 2.0 * math.pi
SETTINGS: dict[str, dict[str, Any]] = {
    "simulated": {},
    "senso_wheel": {},
    "odrive": {"rated_torque": 7.5, "node": 1},
    "odrive_05": {"rated_torque": 7.5, "node": 1},
    "moteus": {"rated_torque": 7.5, "node": 1},
    "cia402": {"rated_torque": 7.5, "node": 1, "increments_per_turn": 65_536},
}


class Truth(NamedTuple):
    """Angle in rad and torque in N m of a sample, nan: no sample (or no torque); state of a status, "": no status."""

    angle: float = math.nan
    torque: float = math.nan
    state: str = ""


def _classic(frame: Any, length: int) -> bool:
    return not (frame.extended or frame.fd or frame.remote) and len(frame.data) == length


def _plausible(angle: float, rate: float, torque: float, most_torque: float = 100.0) -> bool:
    return abs(angle) <= 1000.0 and abs(rate) <= 1000.0 and abs(torque) <= most_torque


def senso_wheel(frame: Any) -> Truth | None:
    """0x210: state nibble 0, 2, 4 or 8 and mode nibble 0, 1, 2, 4 or 8; 0x211: increments, rpm, mN m."""
    if frame.identifier not in (0x210, 0x211) or not _classic(frame, 8):
        return None
    if frame.identifier == 0x211:
        position, rpm, torque = struct.unpack("<ihh", frame.data)
        angle = position * TURN / 40_000
        return Truth(angle, torque / 1000.0) if _plausible(angle, rpm * TURN / 60.0, torque / 1000.0) else None
    state = {0: "off", 2: "ready", 4: "on", 8: "error"}.get(frame.data[0] & 0xF)
    return Truth(state=state) if state and frame.data[0] >> 4 in (0, 1, 2, 4, 8) else None


def odrive(frame: Any) -> Truth | None:
    """Heartbeat 0x21 and estimates 0x29, floats little-endian."""
    return _odrive(frame, new=True)


def odrive_05(frame: Any) -> Truth | None:
    """As 0.6, but bytes 5 to 7 of the heartbeat are error flags."""
    return _odrive(frame, new=False)


def _odrive(frame: Any, new: bool) -> Truth | None:
    if frame.identifier not in (0x21, 0x29) or not _classic(frame, 8):
        return None
    if frame.identifier == 0x29:
        position, rate = struct.unpack("<ff", frame.data)
        good = math.isfinite(position) and math.isfinite(rate) and _plausible(position * TURN, rate * TURN, 0.0)
        return Truth(position * TURN) if good else None
    error, state, fifth, sixth, seventh = struct.unpack("<IBBBB", frame.data)
    if state > 14 or (new and fifth > 15):
        return None
    if error or (not new and (fifth & 1 or sixth & 1 or seventh & 1)):
        return Truth(state="error")
    return Truth(state={0: "off", 1: "off", 8: "on"}.get(state, "ready"))


def moteus(frame: Any) -> Truth | None:
    """The answer to our query, to the byte: mode int8; position, velocity, torque float; fault int8; padding."""
    if frame.identifier != 0x100 or not frame.fd or frame.remote or len(frame.data) < 20:
        return None
    data = frame.data
    if data[:2] != b"\x21\x00" or data[3:5] != b"\x2f\x01" or data[17:19] != b"\x21\x0f" or data[20:].strip(b"\x50"):
        return None
    mode, fault = struct.unpack("<b", data[2:3])[0], struct.unpack("<b", data[19:20])[0]
    position, velocity, torque = struct.unpack("<fff", data[5:17])
    if not all(map(math.isfinite, (position, velocity, torque))) or not 0 <= mode <= 15 or fault < 0:
        return None
    if not _plausible(position * TURN, velocity * TURN, torque):
        return None
    limited_only = fault == 0 or 96 <= fault <= 103
    state = {0: "off", 2: "ready", 3: "ready", 4: "ready", 10: "on"}.get(mode, "error") if limited_only else "error"
    return Truth(position * TURN, torque, state)


def cia402(frame: Any) -> Truth | None:
    """PDO 1 of node 1 (status word, position, torque per mille), PDO 2, emergency, heartbeat."""
    if frame.identifier == 0x181 and _classic(frame, 8):
        word, position, torque = struct.unpack("<Hih", frame.data)
        angle = position * TURN / 65_536
        state = _cia402_state(word)
        return Truth(angle, torque * 7.5e-3, state) if state and _plausible(angle, 0.0, torque * 7.5e-3) else None
    if frame.identifier == 0x081 and _classic(frame, 8):
        return Truth(state="error") if frame.data[:2] != b"\0\0" else None
    if frame.identifier == 0x281 and _classic(frame, 5):
        return None if frame.data[4] in (0, 10) else Truth(state="error")
    if frame.identifier == 0x701 and _classic(frame, 1):
        return Truth(state="off") if frame.data[0] in (0x00, 0x04, 0x7F) else None
    return None


def _cia402_state(word: int) -> str:
    """Bits 0 to 3, 5 and 6 of the status word by the profile's table."""
    low, quick, disabled = word & 0xF, bool(word & 0x20), bool(word & 0x40)
    if disabled:
        return "off" if low == 0 else ""
    if low in (0x8, 0xF):
        return "error"
    if low == 0x0:
        return "off"
    if not quick:
        return "ready" if low == 0x7 else ""
    return {0x1: "ready", 0x3: "ready", 0x7: "on"}.get(low, "")


def simulated(frame: Any) -> Truth | None:
    """Counter below 15 and a CRC that a bit-by-bit division finds; angle of 24 bits in 10 microrad."""
    if frame.identifier != 0x012 or not _classic(frame, 8):
        return None
    data = frame.data
    remainder = 0
    for bit in _bits(bytes([0x12, 0x00]) + data[1:] + b"\0"):
        remainder = (remainder << 1 | bit) ^ (0x11D if remainder & 0x80 else 0)
    state = {0: "off", 1: "ready", 2: "on", 3: "error"}.get(data[1] >> 4)
    if remainder != data[0] or data[1] & 0xF == 15 or state is None:
        return None
    angle = int.from_bytes(data[2:5], "little", signed=True) * 1e-5
    return Truth(angle, state=state)


def _bits(data: bytes) -> list[int]:
    return [byte >> k & 1 for byte in data for k in range(7, -1, -1)]


ORACLES: dict[str, Callable[[Any], Truth | None]] = {
    "simulated": simulated,
    "senso_wheel": senso_wheel,
    "odrive": odrive,
    "odrive_05": odrive_05,
    "moteus": moteus,
    "cia402": cia402,
}
