"""The virtual motor on a virtual clock: frames in, frames out, the same bits every time.

motor = VirtualMotor("senso_wheel", seed=1)
received = motor.exchange(frames, 1e-3)      # frames sent now; what reaches the host within 1 ms
link = SteppedLink(motor)                    # or with the manners of a bus: send, receive(timeout), now
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from steer_env.rig.bus import Health
from steer_env.rig.frame import Frame, Received


class VirtualMotor:
    """Drive, plant and wire of one motor; ``options`` are the motor's own (``motors.make``)."""

    def __init__(self, name: str, seed: int = 0, faults: Sequence[Any] = (), **options: Any) -> None:
        raise NotImplementedError

    def submit(self, frame: Frame) -> bool:
        """The host hands a frame to its controller now; False where that is bus-off or full."""
        raise NotImplementedError

    def advance(self, dt: float) -> list[Received]:
        """Let dt seconds pass; what reached the host meanwhile, in order."""
        raise NotImplementedError

    def exchange(self, frames: Sequence[Frame], dt: float) -> list[Received]:
        """Submit frames now, then let dt seconds pass."""
        for frame in frames:
            self.submit(frame)
        return self.advance(dt)


class SteppedLink:
    """A ``bus.Link`` to a virtual motor: time passes only in ``receive`` and ``advance``."""

    def __init__(self, motor: VirtualMotor) -> None:
        raise NotImplementedError

    def send(self, frame: Frame) -> bool:
        """Hand a frame to the controller at the present virtual time."""
        raise NotImplementedError

    def receive(self, timeout: float) -> Received | None:
        """The next frame; virtual time passes until it comes, at most ``timeout`` s."""
        raise NotImplementedError

    def advance(self, dt: float) -> None:
        """Let dt seconds pass; frames that come meanwhile wait for ``receive``."""
        raise NotImplementedError

    def now(self) -> float:
        """Virtual time in s."""
        raise NotImplementedError

    def health(self) -> Health:
        """Of the host's controller."""
        raise NotImplementedError

    def close(self) -> None:
        """Nothing to let go of."""
        raise NotImplementedError
