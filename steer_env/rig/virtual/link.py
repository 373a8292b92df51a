"""A virtual motor with the manners of a bus, on the virtual clock."""

from __future__ import annotations

from collections import deque

from steer_env.rig.bus import Health
from steer_env.rig.frame import Frame, Received
from steer_env.rig.virtual.motor import VirtualMotor


class SteppedLink:
    """A ``bus.Link`` to a virtual motor: time passes only in ``receive`` and ``advance``."""

    def __init__(self, motor: VirtualMotor) -> None:
        self.motor = motor
        self._received: deque[Received] = deque()
        self._send_errors = 0

    def send(self, frame: Frame) -> bool:
        """Hand a frame to the controller at the present virtual time."""
        taken = self.motor.submit(frame)
        self._send_errors += not taken
        return taken

    def receive(self, timeout: float) -> Received | None:
        """The next frame; virtual time passes until it comes, at most ``timeout`` s."""
        deadline = self.motor.now + max(timeout, 0.0)
        self.advance(0.0)
        while not self._received:
            at = min(max(self.motor.next_event(), self.motor.now), deadline)
            self._received.extend(self.motor.advance_to(at))
            if at >= deadline:
                break
        return self._received.popleft() if self._received else None

    def advance(self, dt: float) -> None:
        """Let dt seconds pass; frames that come meanwhile wait for ``receive``."""
        self._received.extend(self.motor.advance(dt))

    def now(self) -> float:
        """Virtual time in s."""
        return self.motor.now

    def health(self) -> Health:
        """Of the host's controller."""
        return self.motor.health()._replace(send_errors=self._send_errors)

    def close(self) -> None:
        """Nothing to let go of."""

    def __enter__(self) -> SteppedLink:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
