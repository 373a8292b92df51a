"""The drive's side of the SENSO-Wheel: it answers, and sends nothing by itself.

Torque only: friction, damping and stiffness of a command, which the host sends as zero, are not made here.
"""

from __future__ import annotations

import math

from steer_env.rig.frame import Frame
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import DriveState
from steer_env.rig.motors.senso_wheel import ERROR, FAULTS, NORMAL, OFF, ON, QUIT_ERROR, READY
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings

_CODES: dict[DriveState, int] = {"off": OFF, "ready": READY, "on": ON, "error": ERROR}
_BITS = {name: bit for bit, name in FAULTS.items()}


class VirtualDrive(Drive):
    """State machine and answers; the host's watchdog bit is honoured, as dangerous as it is."""

    watchdog_fault = "CAN watchdog"
    _mode = 0
    _guarded = True

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """0x200 and 0x201; everything else, and any other length, is ignored."""
        file = dbc("senso_wheel")
        if frame.extended or frame.remote or len(frame.data) != 8:
            return []
        if frame.identifier == file.identifier("Control"):
            self.feed(now)
            return [self._control(file.decode("Control", frame.data), readings, now)]
        if frame.identifier == file.identifier("NormalCommand"):
            self.feed(now)
            if self.state == "on":
                self.command = file.decode("NormalCommand", frame.data)["Torque"]
            return [self._answer(readings)]
        return []

    def due(self) -> float:
        """As all drives, unless the watchdog is switched off."""
        return super().due() if self._guarded else math.inf

    def _control(self, values: dict[str, float], readings: Readings, now: float) -> Frame:
        transition, mode = int(values["Transition"]), int(values["Mode"])
        self._guarded = not values["WatchdogOff"]
        self.limit = self.options.nominal_torque * values["TorqueLimit"] / 100.0
        if self.state == "error":
            if transition == QUIT_ERROR:
                self.state, self.faults = "off", set()
        elif transition == OFF:
            self.state, self.command = "off", 0.0
        elif transition == READY:
            self.state, self.command, self._mode = "ready", 0.0, mode
        elif transition == ON and self.state == "ready" and self._mode == NORMAL:
            stop = math.radians(values["EndStop"])
            if values["EndStop"] >= 10 and abs(readings.angle) > stop:
                self.trip("switched on outside end stop")
            else:
                self.turn_on(now)
        status = {
            "State": _CODES[self.state],
            "Mode": self._mode,
            "WatchdogOff": 0 if self._guarded else 1,
            "OverloadProtection": 0,
            "EndStopsActive": 0,
            "IndexFound": 0,
            "ReferencingComplete": 0,
            "CpuWatchdogOk": 1,
            "Errors": sum(_BITS[fault] for fault in self.faults),
            "EndStop": values["EndStop"],
            "IndexPosition": 0,
        }
        file = dbc("senso_wheel")
        return Frame(file.identifier("Status"), file.encode("Status", status))

    def _answer(self, readings: Readings) -> Frame:
        own, file = self.mounted(readings), dbc("senso_wheel")
        position = round(own.angle * self.options.increments_per_turn / (2.0 * math.pi))
        values = {"Position": position, "Speed": own.rate, "Torque": own.motor_torque}
        return Frame(file.identifier("NormalAnswer"), file.encode("NormalAnswer", values))
