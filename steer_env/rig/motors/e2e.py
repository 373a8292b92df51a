"""End-to-end protection in the form of AUTOSAR E2E profile 1: a CRC over identity and data, and a counter.

Byte 0 is the CRC, the low nibble of byte 1 the counter 0 .. 14. The CRC (SAE J1850 polynomial 0x1D, start and final
value 0 as the profile applies it) covers the 16-bit data id, low byte first, which is not sent, and then bytes 1 on.
"""

from __future__ import annotations

MODULUS = 15
_POLYNOMIAL = 0x1D


def _table() -> tuple[int, ...]:
    values = []
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ _POLYNOMIAL if value & 0x80 else value << 1
        values.append(value & 0xFF)
    return tuple(values)


_TABLE = _table()


def crc8(data: bytes, start: int = 0) -> int:
    """CRC-8 with polynomial 0x1D, most significant bit first."""
    crc = start
    for byte in data:
        crc = _TABLE[crc ^ byte]
    return crc


def protected(data: bytes, data_id: int) -> bytes:
    """The data with its CRC in byte 0; the counter is already in it."""
    return bytes([crc8(data_id.to_bytes(2, "little") + data[1:])]) + data[1:]


def intact(data: bytes, data_id: int) -> bool:
    """Whether CRC and counter are ones that a sender of this id could have written."""
    return len(data) >= 2 and data[0] == crc8(data_id.to_bytes(2, "little") + data[1:]) and data[1] & 0xF < MODULUS
