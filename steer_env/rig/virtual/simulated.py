"""The drive's side of the simulated motor: it checks what it is told, and answers with counter and checksum."""

from __future__ import annotations

from steer_env.rig.frame import Frame
from steer_env.rig.motors import e2e
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import DriveState
from steer_env.rig.motors.simulated import ERROR, FAULTS, OFF, ON, QUIT_ERROR, READY
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings

_CODES: dict[DriveState, int] = {"off": OFF, "ready": READY, "on": ON, "error": ERROR}


class VirtualDrive(Drive):
    """A command that is damaged, or that repeats the counter of the last one, is no command."""

    _seen = -1
    _counter = 0

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """The command."""
        file = dbc("simulated")
        identifier = file.identifier("Command")
        if frame.key != (identifier, False) or frame.remote or len(frame.data) != file.length("Command"):
            return []
        if not e2e.intact(frame.data, identifier):
            return []
        values = file.decode("Command", frame.data)
        if values["Counter"] == self._seen:
            return []
        self._seen = int(values["Counter"])
        self.feed(now)
        self._obey(int(values["Request"]), values["Torque"], now)
        return self._answer(readings)

    def _obey(self, request: int, torque: float, now: float) -> None:
        if self.state == "error":
            if request == QUIT_ERROR:
                self.state, self.faults = "off", set()
        elif request == OFF:
            self.state, self.command = "off", 0.0
        elif request == READY:
            self.state, self.command = "ready", 0.0
        elif request == ON and self.state == "ready":
            self.turn_on(now)
        if self.state == "on":
            self.command = torque

    def _answer(self, readings: Readings) -> list[Frame]:
        own = self.mounted(readings)
        if not self.frozen_counter:
            self._counter = (self._counter + 1) % e2e.MODULUS
        motion = {"Crc": 0, "Counter": self._counter, "Rate": own.rate, "Torque": own.motor_torque}
        sample = {
            "Crc": 0,
            "Counter": self._counter,
            "State": _CODES[self.state],
            "Angle": own.angle,
            "SensorTorque": own.sensor_torque,
            "Faults": sum(1 << FAULTS.index(fault) for fault in self.faults),
        }
        return [self._frame("Motion", motion), self._frame("Sample", sample)]

    @staticmethod
    def _frame(name: str, values: dict[str, float]) -> Frame:
        file = dbc("simulated")
        identifier = file.identifier(name)
        return Frame(identifier, e2e.protected(file.encode(name, values), identifier))
