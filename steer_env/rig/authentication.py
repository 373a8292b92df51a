"""Frames between two halves of our own that nobody else can make, change or play back: for gateways.

    outgoing = Sealer(key)                                 # at the one end
    incoming = Opener(key, not_before=time.time_ns() - 5_000_000_000)      # at the other
    opened = incoming.open(outgoing.seal(frame))           # the frame, or the reason why not

No drive of ours can do this; it is off unless both ends of a link are ours. A sealed frame is a CAN-FD frame with the
same identifier: freshness (8 bytes, big-endian), HMAC-SHA-256 over identifier, freshness and content truncated to 8
bytes (RFC 2104; the shape of AUTOSAR SecOC, with the freshness in full so that no synchronisation is needed), one
byte of length and kind, the data, padding. An attacker who may try 10 000 frames a second guesses a code of 64 bits in
30 million years.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
import time
from collections.abc import Callable

from steer_env.errors import InputError
from steer_env.rig.bus import Health, Link
from steer_env.rig.frame import Frame, Received

MAC_BYTES = 8
HEADER = struct.Struct(">Q8sB")  # freshness, code, length and kind
FD_LENGTHS = (20, 24, 32, 48, 64)
SHORTEST_KEY = 16
_FD, _REMOTE = 0x40, 0x80
_LENGTH = 0x3F


def _checked_key(key: bytes) -> bytes:
    if len(key) < SHORTEST_KEY:
        raise InputError("key", f"has {len(key)} bytes", f"give at least {SHORTEST_KEY} random bytes")
    return bytes(key)


def _code(key: bytes, frame: Frame, freshness: int, kind: int, content: bytes) -> bytes:
    address = struct.pack(">IBQB", frame.identifier, frame.extended, freshness, kind)
    return hmac.digest(key, address + content, hashlib.sha256)[:MAC_BYTES]


class Sealer:
    """Seals frames under a key of at least 16 bytes; ``clock`` gives ns that never go back over restarts."""

    def __init__(self, key: bytes, clock: Callable[[], int] = time.time_ns) -> None:
        self._key, self._clock, self._last = _checked_key(key), clock, 0

    def seal(self, frame: Frame) -> Frame:
        """The frame that carries this one; ValueError where its data do not fit (47 bytes)."""
        self._last = freshness = max(self._last + 1, self._clock())
        length = len(frame.data)
        if HEADER.size + length > FD_LENGTHS[-1]:
            raise ValueError(f"{length} bytes of data do not fit into a sealed frame")
        kind = length | (_FD if frame.fd else 0) | (_REMOTE if frame.remote else 0)
        sealed = HEADER.pack(freshness, _code(self._key, frame, freshness, kind, frame.data), kind) + frame.data
        padded = next(size for size in FD_LENGTHS if size >= len(sealed))
        return Frame(frame.identifier, sealed.ljust(padded, b"\0"), frame.extended, fd=True)


class Opener:
    """Opens what a ``Sealer`` of the same key sealed; nothing older than ``not_before`` (ns), nothing twice."""

    def __init__(self, key: bytes, not_before: int) -> None:
        self._key, self._last = _checked_key(key), not_before

    def open(self, sealed: Frame) -> Frame | str:
        """The frame inside, or why it cannot be believed."""
        if not sealed.fd or sealed.remote or len(sealed.data) not in FD_LENGTHS:
            return "not a sealed frame"
        freshness, code, kind = HEADER.unpack_from(sealed.data)
        content = sealed.data[HEADER.size :]
        data, padding = content[: kind & _LENGTH], content[kind & _LENGTH :]
        if not hmac.compare_digest(code, _code(self._key, sealed, freshness, kind, data)) or any(padding):
            return "wrong authentication code"
        if freshness <= self._last:
            return "played back"
        self._last = freshness
        return Frame(sealed.identifier, data, sealed.extended, bool(kind & _FD), bool(kind & _REMOTE))


class AuthenticatedLink:
    """A ``Link`` whose frames are sealed; ``rejected`` counts what came and could not be believed."""

    def __init__(self, link: Link, key: bytes, not_before: int) -> None:
        self._link, self._sealer, self._opener = link, Sealer(key), Opener(key, not_before)
        self.rejected = 0

    def send(self, frame: Frame) -> bool:
        """Seal and send a frame; False where the controller did not take it."""
        return self._link.send(self._sealer.seal(frame))

    def receive(self, timeout: float) -> Received | None:
        """The next frame that can be believed, waiting at most ``timeout`` s for one that cannot."""
        received = self._link.receive(timeout)
        if received is None:
            return None
        opened = self._opener.open(received.frame)
        if isinstance(opened, str):
            self.rejected += 1
            return None
        return received._replace(frame=opened)

    def now(self) -> float:
        """The clock of the link below, in s."""
        return self._link.now()

    def health(self) -> Health:
        """Of the link below."""
        return self._link.health()

    def close(self) -> None:
        """Let go of the link below."""
        self._link.close()
