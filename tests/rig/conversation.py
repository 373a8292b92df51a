"""A host with no safety, no pacing and no patience, to talk to virtual motors in tests."""

from __future__ import annotations

from typing import NamedTuple

from steer_env.rig.frame import Frame, Received
from steer_env.rig.motors import make
from steer_env.rig.motors.motor import DriveStatus, Motor, Rejected, Sample
from steer_env.rig.virtual import settings
from steer_env.rig.virtual.motor import VirtualMotor
from steer_env.rig.virtual.wheel import PERFECT

PERIOD = 1e-3  # s


class Heard(NamedTuple):
    """What came in one period."""

    statuses: list[DriveStatus]
    samples: list[Sample]
    rejected: list[Rejected]
    frames: list[Received]


class Conversation:
    """One motor object and the virtual motor it talks to, a period of 1 ms at a time."""

    def __init__(self, name: str, host: dict | None = None, **virtual) -> None:
        self.motor: Motor = make(name, **{**settings(name), **(host or {})})
        quiet = {"noise": False, "imperfections": PERFECT}
        self.virtual = VirtualMotor(name, **{**quiet, **virtual})
        self.sent: list[Frame] = []

    def period(self, *frames: Frame) -> Heard:
        """Send frames, let 1 ms pass, decode what came."""
        self.sent += frames
        received = self.virtual.exchange(frames, PERIOD)
        said = [message for each in received for message in self.motor.decode(each.frame)]
        kinds = [[m for m in said if isinstance(m, kind)] for kind in (DriveStatus, Sample, Rejected)]
        return Heard(*kinds, received)

    def until(self, state: str, periods: int = 200) -> list[DriveStatus]:
        """Bring the drive "on" or "off", one transition per status; the different statuses on the way."""
        ask = self.motor.bring_up if state == "on" else self.motor.bring_down
        way: list[DriveStatus] = []
        frames = self.motor.poll_frames() or self.motor.torque_frames(0.0)
        for _ in range(periods):
            heard = self.period(*frames)
            waiting = self.motor.poll_frames() or self.motor.torque_frames(0.0)
            if heard.statuses:
                status = heard.statuses[-1]
                way += [status] if status not in way else []
                if status.state == state:
                    return way
                frames = ask(status) or waiting
            else:
                frames = waiting
        raise AssertionError(f"not {state} after {periods} periods: {way}")

    def run(self, torque: float, periods: int) -> list[Heard]:
        """Command a torque in N m, period by period."""
        return [self.period(*self.motor.torque_frames(torque)) for _ in range(periods)]
