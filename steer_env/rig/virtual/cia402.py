"""The drive's side of CiA 402 in cyclic synchronous torque: acts and answers at each SYNC."""

from __future__ import annotations

import math
import struct
from typing import Any, ClassVar

from steer_env.rig.frame import Frame
from steer_env.rig.motors.cia402 import (
    CYCLIC_SYNCHRONOUS_TORQUE,
    MAX_TORQUE,
    NMT_START,
    SDO_ABORT,
    SDO_READ,
    SDO_WRITE_2,
    SDO_WRITTEN,
    STATUS_WORDS,
)
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import DriveState
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings

_WORDS = {name: value for _, value, name, _ in STATUS_WORDS}
_STATES: dict[str, DriveState] = {name: state for _, _, name, state in STATUS_WORDS}
_NMT_STOP, _NMT_PRE_OPERATIONAL, _NMT_RESET = 0x02, 0x80, 0x81
_PRE_OPERATIONAL, _OPERATIONAL = 0x7F, 0x05
_LIFE_GUARD, _GENERIC = 0x8130, 0x1000  # error codes of emergencies, CiA 301
_FAULT_RESET = 0x80
_SDO = struct.Struct("<BHBI")
_CONTENT_2 = 0x4B  # two bytes, in the frame
_NO_SUCH_OBJECT, _NO_SUCH_COMMAND = 0x0602_0000, 0x0504_0001


class VirtualDrive(Drive):
    """Node state, the profile's state machine, and the watchdog over commands (as a heartbeat consumer would be)."""

    SETTINGS: ClassVar[dict[str, Any]] = {"rated_torque": 7.5, "increments_per_turn": 65_536, "rate_unit": 1e-3}

    def __init__(self, motor: Any, watchdog_s: float | None) -> None:
        self._file = dbc("cia402")
        self._offset = motor.options.node - 1
        self._node_state = _PRE_OPERATIONAL
        self._profile = "switch on disabled"
        self._received: dict[str, float] | None = None
        self._last_control = 0
        self._emergencies: list[int] = []
        super().__init__(motor, watchdog_s)
        self.cycles = {"Heartbeat": 0.05}
        self.power_up(0.0)

    def power_up(self, now: float) -> None:
        """Pre-operational, voltage disabled."""
        super().power_up(now)
        self._node_state, self._received, self._last_control = _PRE_OPERATIONAL, None, 0
        self._go("switch on disabled")

    def trip(self, fault: str) -> None:
        """Fault, announced by an emergency at the next tick."""
        super().trip(fault)
        self._profile = "fault"
        self._emergencies.append(_LIFE_GUARD if fault == self.watchdog_fault else _GENERIC)

    def due(self) -> float:
        """As all drives; an emergency is due at once."""
        return -math.inf if self._emergencies and self.powered else super().due()

    def tick(self, readings: Readings, now: float) -> list[Frame]:
        """Watchdog, heartbeat, emergencies."""
        frames = super().tick(readings, now)
        for code in self._emergencies:
            frames.append(self._frame("Emergency", {"ErrorCode": code, "ErrorRegister": 1}))
        self._emergencies = []
        return frames

    def cyclic(self, name: str, readings: Readings, now: float) -> list[Frame]:
        """The heartbeat."""
        return [self._frame(name, {"State": self._node_state})]

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """NMT, PDO 1 and SYNC."""
        if frame.extended or frame.remote:
            return []
        if frame.identifier == self._file.identifier("Nmt") and len(frame.data) == 2:
            self._manage(frame.data[0], frame.data[1], now)
            return []
        if frame.identifier == 0x600 + self.options.node and len(frame.data) == _SDO.size:
            return [Frame(0x580 + self.options.node, self._serve(*_SDO.unpack(frame.data)))]
        if self._node_state != _OPERATIONAL:
            return []
        if frame.identifier == self._file.identifier("ReceivePdo1") + self._offset:
            if len(frame.data) == self._file.length("ReceivePdo1"):
                self._received = self._file.decode("ReceivePdo1", frame.data)
            return []
        if frame.identifier == self._file.identifier("Sync"):
            return self._synchronise(readings, now)
        return []

    def _serve(self, first: int, index: int, sub: int, content: int) -> bytes:
        """The answer of the SDO server, which has the torque limit and nothing else."""
        if (index, sub) != (MAX_TORQUE, 0):
            return _SDO.pack(SDO_ABORT, index, sub, _NO_SUCH_OBJECT)
        if first == SDO_WRITE_2:
            self.limit = (content & 0xFFFF) / 1000.0 * self.motor.rated_torque
            return _SDO.pack(SDO_WRITTEN, index, sub, 0)
        if first == SDO_READ:
            return _SDO.pack(_CONTENT_2, index, sub, round(1000.0 * self.limit / self.motor.rated_torque))
        return _SDO.pack(SDO_ABORT, index, sub, _NO_SUCH_COMMAND)

    def _manage(self, command: int, node: int, now: float) -> None:
        if node not in (0, self.options.node):
            return
        if command == NMT_START:
            self._node_state = _OPERATIONAL
        elif command in (_NMT_STOP, _NMT_PRE_OPERATIONAL):
            self._node_state = _PRE_OPERATIONAL
            self._go("switch on disabled")
        elif command == _NMT_RESET:
            self.power_up(now)

    def _synchronise(self, readings: Readings, now: float) -> list[Frame]:
        if self._received is not None:
            self._obey(self._received, now)
            self._received = None
        own = self.mounted(readings)
        turn, unit = self.options.increments_per_turn, self.options.rate_unit
        first = {
            "StatusWord": _WORDS[self._profile],
            "Position": round(own.angle / (2.0 * math.pi) * turn),
            "Torque": own.motor_torque / self.motor.rated_torque,
        }
        velocity = 0 if math.isnan(unit) else round(own.rate / unit)
        second = {"Velocity": velocity, "Mode": CYCLIC_SYNCHRONOUS_TORQUE}
        return [self._frame("TransmitPdo2", second), self._frame("TransmitPdo1", first)]

    def _obey(self, values: dict[str, float], now: float) -> None:
        control, last = int(values["ControlWord"]), self._last_control
        self._last_control = control
        self.feed(now)
        if self._profile == "fault":
            if control & _FAULT_RESET and not last & _FAULT_RESET:
                self.faults = set()
                self._go("switch on disabled")
            return
        if not control & 0x02:
            self._go("switch on disabled")  # disable voltage
        elif not control & 0x04:
            self._go("quick stop active" if self.state == "on" else "switch on disabled")
        elif self._profile == "switch on disabled":
            if control & 0x0F == 0x06:
                self._go("ready to switch on")
        elif self._profile != "quick stop active":
            self._climb(control, now)
        if self.state == "on":
            if values["Mode"] == CYCLIC_SYNCHRONOUS_TORQUE:
                self.command = values["Torque"] * self.motor.rated_torque
            else:
                self.trip("mode")

    def _climb(self, control: int, now: float) -> None:
        """Transitions among ready to switch on, switched on and operation enabled."""
        if not control & 0x01:
            self._go("ready to switch on")
        elif not control & 0x08:
            self._go("switched on")
        elif self._profile == "switched on":
            self.turn_on(now)
            self._profile = "operation enabled"

    def _go(self, profile: str) -> None:
        self._profile, self.state, self.command = profile, _STATES[profile], 0.0

    def _frame(self, name: str, values: dict[str, float]) -> Frame:
        return Frame(self._file.identifier(name) + self._offset, self._file.encode(name, values))
