"""When a frame came, on the host's clock: not when a busy program got round to reading it.

Interfaces stamp a frame as it arrives, on a clock of their own (``Received.device_time``: the kernel's, or the
adapter's). What lies between that clock and ours is the least that was ever seen between stamp and reading. A
measurement that is stamped 5 ms late is, at 5 rad/s, wrong by 0.025 rad.
"""

from __future__ import annotations

from steer_env.rig.frame import Received

DRIFT = 2e-4  # by which two clocks may run apart: a cheap crystal's 100 ppm on either side
STEPPED = 0.5  # s: a stamp that is so far from where it should be is that of a clock that was set


class Arrival:
    """Turns stamps into times on the host's clock in s, never later than the frame was read."""

    def __init__(self) -> None:
        self._offset: float | None = None
        self._read = 0.0

    def of(self, received: Received) -> float:
        """When a frame came; frames in the order in which they were read."""
        between, now = received.host_time - received.device_time, received.host_time
        if self._offset is None or abs(between - self._offset) > STEPPED:
            self._offset = between
        self._offset = min(self._offset + DRIFT * (now - self._read if self._read else 0.0), between)
        self._read = now
        return received.device_time + self._offset
