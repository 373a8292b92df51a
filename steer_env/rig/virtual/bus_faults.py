"""Frames of a third node on the bus: one that babbles, and one that pretends to be us or the drive."""

from __future__ import annotations

import math

from steer_env.rig.frame import Frame
from steer_env.rig.motors.motor import Motor
from steer_env.rig.virtual.faults import Injector
from steer_env.rig.virtual.wire import frame_time

# Wins every arbitration but that for NMT; eight bytes, the longest a classic frame can hold the bus.
BABBLE = Frame(0x001, bytes(8))


class BusFaults:
    """When that node sends next, and what. It repeats what it heard, so its frames are as good as ours."""

    def __init__(self, injector: Injector, motor: Motor) -> None:
        self._injector = injector
        self._commands, self._answers = motor.command_identifiers, motor.reply_identifiers
        self._bitrate = motor.bitrate
        self._command: Frame | None = None
        self._answer: Frame | None = None
        self._next: dict[str, float] = {}

    def heard(self, frame: Frame, from_host: bool) -> None:
        """Remember the last command and the last answer."""
        if from_host and frame.key in self._commands:
            self._command = frame
        elif not from_host and frame.key in self._answers:
            self._answer = frame

    def due(self, now: float) -> float:
        """When it sends next, in s."""
        return min((at for kind, at in self._due(now).items()), default=math.inf)

    def frames(self, now: float) -> list[Frame]:
        """What it sends now."""
        out: list[Frame] = []
        for kind, at in self._due(now).items():
            if at <= now:
                self._next[kind] = now + self._period(kind, now)
                frame = {"babbling_node": BABBLE, "injected_command": self._command}.get(kind, self._answer)
                out += [frame] if frame is not None else []
        return out

    def _due(self, now: float) -> dict[str, float]:
        kinds = ("babbling_node", "injected_command", "injected_answer")
        acting = [kind for kind in kinds if self._injector.acts(kind, now)]
        return {kind: max(self._next.get(kind, now), now) for kind in acting}

    def _period(self, kind: str, now: float) -> float:
        size = self._injector.size(kind, now) or 0.0
        if kind != "babbling_node":
            return 1.0 / size
        return frame_time(BABBLE, self._bitrate) / max(size, 1e-3)
