"""The drive's side of ODrive's CANSimple, both firmwares: it sends by itself, configured for a fast loop."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from steer_env.rig.frame import Frame
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.odrive import CLOSED_LOOP, FAULTS, IDLE, PASSTHROUGH, TORQUE_CONTROL
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings

NAN = float("nan")


class VirtualDrive(Drive):
    """Encoder (and torque) estimates every 1 ms, a heartbeat every 10 ms, well within the watchdog's time.

    Of its limits the current's is obeyed; fading towards the speed limit is not made here.
    """

    SETTINGS: ClassVar[dict[str, Any]] = {"rated_torque": 7.5}
    fault = "estop"

    def __init__(self, motor: Any, watchdog_s: float | None) -> None:
        self._new = motor.options.firmware == "0.6"
        self._file = dbc("odrive_06" if self._new else "odrive_05")
        self._base = motor.options.node << 5
        self._torque_mode = False
        super().__init__(motor, watchdog_s)
        self.cycles = {"EncoderEstimates": 1e-3, "Heartbeat": 10e-3}
        self.power_up(0.0)

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """Commands to this node."""
        if frame.extended or frame.identifier & ~0x1F != self._base:
            return []
        message = self._file.by_identifier.get(frame.identifier & 0x1F)
        if not self._new:
            self.feed(now)  # any frame addressed to the node
        if message is None:
            return []
        name = message.name
        if "Drive" in message.senders:
            asked = not self._new and (frame.remote or not frame.data)
            return self.cyclic(name, readings, now) if asked and name in self.cycles else []
        if frame.remote or len(frame.data) < message.length:
            return []
        self._obey(name, self._file.decode(name, frame.data[: message.length]), now)
        return []

    def _obey(self, name: str, values: dict[str, float], now: float) -> None:
        if name == "SetInputTorque":
            self.feed(now)
            if self.state == "on":
                self.obey(values["Torque"])
        elif name == "SetLimits" and self.options.torque_constant is not None:
            if math.isfinite(values["CurrentLimit"]):
                self.limit = self.options.torque_constant * max(values["CurrentLimit"], 0.0)
        elif name == "SetControllerMode":
            self._torque_mode = (values["ControlMode"], values["InputMode"]) == (TORQUE_CONTROL, PASSTHROUGH)
        elif name == "SetAxisState" and values["AxisState"] == IDLE:
            self.state = "error" if self.faults else "off"
            self.command = 0.0
        elif name == "SetAxisState" and values["AxisState"] == CLOSED_LOOP:
            if self.state == "off" and self._torque_mode:
                self.turn_on(now)
        elif name == "ClearErrors":
            self.faults = set()
            if self.state == "error":
                self.state = "off"
        elif name == "Estop":
            self.trip("estop")

    def cyclic(self, name: str, readings: Readings, now: float) -> list[Frame]:
        """Estimates, or the heartbeat."""
        if name == "Heartbeat":
            return [self._frame(name, self._heartbeat())]
        own = self.mounted(readings)
        angle = NAN if self.spoiled else own.angle
        frames = [self._frame(name, {"Angle": angle, "Rate": own.rate})]
        if self._new:
            frames.insert(0, self._frame("Torques", {"Target": self.command, "Estimate": own.motor_torque}))
        return frames

    def _heartbeat(self) -> dict[str, float]:
        bits = {name: bit for bit, name in FAULTS["0.6" if self._new else "0.5"].items()}
        values: dict[str, float] = {
            "AxisError": sum(bits[fault] for fault in self.faults),
            "AxisState": CLOSED_LOOP if self.state == "on" else IDLE,
            "TrajectoryDone": 0,
        }
        if self._new:
            return {**values, "ProcedureResult": 0}
        return {**values, "MotorErrorFlag": 0, "EncoderErrorFlag": 0, "ControllerErrorFlag": 0}

    def _frame(self, name: str, values: dict[str, float]) -> Frame:
        return Frame(self._base | self._file.identifier(name), self._file.encode(name, values))
