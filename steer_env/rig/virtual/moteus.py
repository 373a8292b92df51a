"""The drive's side of moteus: it answers queries and holds a command as long as that is valid.

Torque only: a command that would close the position loop (gains not scaled to zero) is a fault here.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from steer_env.rig.frame import Frame
from steer_env.rig.motors import moteus_frames as registers
from steer_env.rig.motors.moteus import FAULTS, HOST, REPLY, TURN
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.wheel import Readings

_CODES = {name: code for code, name in FAULTS.items()}


class VirtualDrive(Drive):
    """Modes stopped, position, timeout and fault."""

    SETTINGS: ClassVar[dict[str, Any]] = {"rated_torque": 7.5}
    watchdog_s = 0.1  # as delivered
    fault = "motor driver"
    _valid = 0.1

    def receive(self, frame: Frame, readings: Readings, now: float) -> list[Frame]:
        """A frame to this node from any source; the answer goes to that source."""
        if not frame.fd or frame.remote or frame.identifier & 0x7F != self.options.node or frame.identifier > 0xFFFF:
            return []
        asked = registers.registers_of(frame.data)
        if asked is None:
            return []
        if registers.MODE in asked.writes:
            self._obey(asked.writes, now)
        source = frame.identifier >> 8
        if not source & REPLY or not asked.reads:
            return []
        return [self._answer(source & ~REPLY, readings)]

    def due(self) -> float:
        """The end of the present command."""
        return self._fed + self._valid if self.powered and self.state == "on" else math.inf

    def tick(self, readings: Readings, now: float) -> list[Frame]:
        """Time over: the timeout mode, until stopped."""
        if self.state == "on" and now >= self._fed + self._valid:
            self.trip("watchdog")
        return []

    def _obey(self, writes: dict[int, float], now: float) -> None:
        mode = writes[registers.MODE]
        if mode == registers.STOPPED:
            self.state, self.command, self.faults = "off", 0.0, set()
        elif mode == registers.POSITION_MODE and self.state != "error":
            gains = [
                writes.get(register, 1.0)
                for register in (registers.KP_SCALE, registers.KD_SCALE, registers.ILIMIT_SCALE)
            ]
            if any(gains):
                self.trip("motor not configured")
                return
            given = writes.get(registers.WATCHDOG, 0.0)
            self._valid = math.inf if math.isnan(given) else given or self.watchdog_s
            if self.state != "on":
                self.turn_on(now)
            self.feed(now)
            limit = writes.get(registers.MAX_TORQUE, math.nan)
            torque = writes.get(registers.TORQUE, 0.0)
            self.obey(torque if math.isnan(limit) else min(max(torque, -limit), limit))

    def _answer(self, destination: int, readings: Readings) -> Frame:
        own = self.mounted(readings)
        mode, fault = {"on": registers.POSITION_MODE, "error": registers.FAULTED}.get(self.state, registers.STOPPED), 0
        if "watchdog" in self.faults:
            mode = registers.TIMEOUT
        elif self.faults:
            fault = _CODES[sorted(self.faults)[0]]
        position = math.nan if self.spoiled else own.angle / TURN
        report = registers.Report(mode, position, own.rate / TURN, own.motor_torque, fault)
        identifier = self.options.node << 8 | (destination or HOST)
        return Frame(identifier, registers.report_data(report), extended=identifier > 0x7FF, fd=True)
