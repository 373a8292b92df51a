"""One CAN frame, as it is on the wire: everything above and below it may be simulated or real."""

from __future__ import annotations

from typing import NamedTuple


class Frame(NamedTuple):
    """A classic or FD data frame; ``remote`` marks a classic frame that only asks (it has no data).

    ``identifier`` has 11 bits, or 29 where ``extended``.
    """

    identifier: int
    data: bytes
    extended: bool = False
    fd: bool = False
    remote: bool = False

    @property
    def key(self) -> tuple[int, bool]:
        """What tells frames apart on a bus: (identifier, extended); 0x201 with 11 and with 29 bits are two."""
        return self.identifier, self.extended


class Received(NamedTuple):
    """A frame and when it came, in s.

    ``device_time`` is the interface's own clock (its origin and drift are the interface's), ``host_time`` is
    ``time.monotonic()`` just after the frame was handed to us, or the virtual clock for both.
    """

    frame: Frame
    device_time: float
    host_time: float
