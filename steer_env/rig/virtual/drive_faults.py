"""Faults inside the drive: its supply, its sensors, its current loop."""

from __future__ import annotations

from typing import Any

from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.faults import Injector
from steer_env.rig.virtual.wheel import Readings


class DriveFaults:
    """What the faults that act make of a drive. Whatever they do, a drive that is off gives no torque."""

    def __init__(self, injector: Injector, drive: Drive) -> None:
        self._injector, self._drive = injector, drive
        self._tripped = False
        self._stuck: Readings | None = None
        self._latched: float | None = None
        self._last_target = 0.0

    def edge(self, now: float) -> None:
        """A fault begins or ends now."""
        drive: Any = self._drive
        acts = self._injector.acts
        if acts("power_drop", now) and drive.powered:
            drive.power_down()
        elif not acts("power_drop", now) and not drive.powered:
            drive.power_up(now)
        if acts("drive_fault", now) and not self._tripped:
            self._tripped = True
            drive.trip(drive.fault)
        drive.frozen_counter = acts("frozen_counter", now)
        drive.spoiled = acts("sensor_not_finite", now)
        if acts("latched_torque", now) and drive.state == "on":
            self._latched = self._last_target if self._latched is None else self._latched
        else:
            self._latched = None

    def readings(self, readings: Readings, now: float) -> Readings:
        """What the sensors say."""
        if not self._injector.acts("stuck_sensor", now):
            self._stuck = None
        elif self._stuck is None:
            self._stuck = readings
        readings = self._stuck or readings
        jump = self._injector.size("sensor_jump", now) or 0.0
        noise = self._injector.size("sensor_noise", now)
        extra = 0.0 if noise is None else noise * self._injector.noise()
        return readings._replace(angle=readings.angle + jump + extra)

    def target(self, target: float, now: float) -> float:
        """Torque in N m that the current loop makes of its target."""
        if self._drive.state != "on":
            self._latched, self._last_target = None, 0.0
            return 0.0
        gain = self._injector.size("torque_gain", now)
        self._last_target = target if gain is None else gain * target
        return self._last_target if self._latched is None else self._latched
