"""What the virtual drives have together: four states, faults that latch, a watchdog of their own, and the mounting.

A drive's frames are made from the same .dbc (or codec) file as the host's. Angles and torques in a drive are in its own
direction; ``mounted`` and ``target`` turn them, so that a wrongly configured host is noticed as on a real rig.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from steer_env.rig.frame import Frame
from steer_env.rig.motors.motor import DriveState
from steer_env.rig.virtual.wheel import Readings

NEVER = math.inf
# s without commands until a virtual drive gives up, unless its protocol has a default. Ours: of the real ones no source
# tells it, or it is configured.
WATCHDOG = 0.05


class Drive:
    """One drive; protocols override ``receive`` and, if the drive sends by itself, ``cyclic``.

    ``command`` is in N m in the drive's direction, ``limit`` the most it gives in N m; ``cycles`` maps the name of a
    message to its period in s. ``SETTINGS`` are options of the motor that have no default.
    """

    SETTINGS: ClassVar[dict[str, Any]] = {}
    fault = "overcurrent"  # the one that "drive_fault" raises
    watchdog_s = WATCHDOG
    watchdog_fault = "watchdog"
    cycles: dict[str, float]

    def __init__(self, motor: Any, watchdog_s: float | None) -> None:
        self.motor, self.options = motor, motor.options
        if watchdog_s is not None:
            self.watchdog_s = watchdog_s
        self.cycles = {}
        self.powered = True
        self.state: DriveState = "off"
        self.faults: set[str] = set()
        self.command = 0.0
        self.limit = self.motor.rated_torque  # N m: what it gives at most
        self.frozen_counter = False
        self.spoiled = False  # sends values that are not finite, where the protocol can
        self._fed = 0.0
        self._next: dict[str, float] = {}
        self.power_up(0.0)

    def power_up(self, now: float) -> None:
        """Start anew, as after the supply came back."""
        self.powered, self.state, self.command = True, "off", 0.0
        self.limit = self.motor.rated_torque
        self.faults = set()
        self._next = {name: now + period for name, period in self.cycles.items()}

    def power_down(self) -> None:
        """The supply is gone: no current, no frames, nothing remembered."""
        self.powered, self.state, self.command = False, "off", 0.0

    def trip(self, fault: str) -> None:
        """A fault: no current until it is cleared."""
        self.faults.add(fault)
        self.state, self.command = "error", 0.0

    def feed(self, now: float) -> None:
        """The watchdog has heard from the host."""
        self._fed = now

    def turn_on(self, now: float) -> None:
        """Current on, with a torque of zero."""
        self.state, self.command = "on", 0.0
        self.feed(now)

    def obey(self, torque: float) -> None:
        """Take a torque command in N m; one that is no number switches the drive off."""
        if math.isnan(torque):
            self.trip(self.fault)
        else:
            self.command = torque

    def target(self) -> float:
        """Torque in N m, positive to the left, that the current loop shall give."""
        limit = min(self.limit, self.motor.rated_torque)
        return self.options.sign * min(max(self.command, -limit), limit) if self.state == "on" and self.powered else 0.0

    def mounted(self, readings: Readings) -> Readings:
        """Readings in the drive's own direction and from its own zero."""
        sign = self.options.sign
        return Readings(
            sign * readings.angle + self.options.zero,
            sign * readings.rate,
            sign * readings.motor_torque,
            sign * readings.sensor_torque,
        )

    def due(self) -> float:
        """When the drive next does something by itself, in s."""
        if not self.powered:
            return NEVER
        guarded = self._fed + self.watchdog_s if self.state == "on" and self.watchdog_s > 0.0 else NEVER
        return min([guarded, *self._next.values()])

    def tick(self, readings: Readings, now: float) -> list[Frame]:
        """What is due: the watchdog, cyclic messages. Called at the time that ``due`` told."""
        if self.state == "on" and self.watchdog_s > 0.0 and now >= self._fed + self.watchdog_s:
            self.trip(self.watchdog_fault)
        frames: list[Frame] = []
        for name, at in self._next.items():
            if now >= at:
                self._next[name] = at + self.cycles[name]
                frames += self.cyclic(name, readings, now)
        return frames

    def cyclic(self, name: str, readings: Readings, now: float) -> list[Frame]:
        """Frames of one of ``cycles``."""
        raise NotImplementedError

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """Take a frame in and answer."""
        raise NotImplementedError
