"""mjbots moteus over CAN FD (1 and 5 Mbit/s): position mode with every gain scaled to zero and a torque fed forward.

The command is valid for the drive's watchdog time (100 ms unless configured or given here); then the drive enters its
timeout mode, which is latched until it is stopped. Each command is answered with mode, position, velocity, torque and
fault. Position is that of the output shaft; the drive must be calibrated beforehand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.motors import moteus_frames as registers
from steer_env.rig.motors.motor import (
    DriveState,
    DriveStatus,
    Message,
    Options,
    OwnLimit,
    Rejected,
    Sample,
    believed,
    checked_options,
    checked_torque,
)

HOST = 0  # our own identifier on the bus
REPLY = 0x80  # set in the source: please answer
TURN = 2.0 * math.pi
UNANSWERED = 10  # commands without an answer after which the drive must be brought up anew
_STATES: dict[int, DriveState] = {
    registers.STOPPED: "off",
    registers.FAULTED: "error",
    2: "ready",
    3: "ready",
    4: "ready",
    registers.POSITION_MODE: "on",
    registers.TIMEOUT: "error",
}
_STARTING = (registers.STOPPED, 2, 3, 4)  # modes on the way to the position mode
_LAST_MODE = 15
FAULTS = {
    32: "calibration",
    33: "motor driver",
    34: "overvoltage",
    35: "encoder",
    36: "motor not configured",
    37: "pwm cycle overrun",
    38: "overtemperature",
    39: "outside limit",
    40: "undervoltage",
    41: "config changed",
    42: "theta invalid",
    43: "position invalid",
    44: "driver enable",
    45: "stop position deprecated",
    46: "timing violation",
    47: "bemf feedforward",
    48: "invalid limits",
}
_LIMITING = range(96, 104)  # codes that say which limit acts, without a fault


@dataclass(frozen=True)
class MoteusOptions(Options):
    """``rated_torque`` must be given. ``watchdog_s`` goes with every command; 0: the drive's own."""

    node: int = 1
    watchdog_s: float = 0.0


class Moteus:
    """A ``Motor``. A command frame contains the mode, so one that would turn the drive on is only built when asked."""

    name = "moteus"
    bitrate, data_bitrate, counter_modulus = 1_000_000, 5_000_000, 0
    own_limit: OwnLimit = "set"  # it goes with every command
    asking_identifiers: frozenset[tuple[int, bool]] = frozenset()

    def __init__(self, options: MoteusOptions) -> None:
        self.rated_torque = checked_options(options, self.name, range(1, 128))
        if not 0.0 <= options.watchdog_s <= 1.0:  # not nan either, which would switch it off
            raise InputError("motor moteus", f"watchdog_s is {options.watchdog_s}", "give 0 to 1 s; 0: the drive's own")
        self.options = options
        self._enabled = self._failed = False
        self._unanswered = 0
        self._limit = self.rated_torque
        # Any source may command the node, with or without a wish for an answer.
        commands = [source << 8 | options.node for source in range(256)]
        self.command_identifiers = _keys(commands)
        self.reply_identifiers = _keys([options.node << 8 | HOST])

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """Nothing now: the largest torque is a field of every command."""
        self._limit = min(torque, self.rated_torque)
        return ()

    def told_limit(self, frame: Frame) -> float | None:
        """Never told."""
        return None

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """Position mode with a torque fed forward once brought up; before and after that "stopped".

        A drive that is silent for a while may have lost its supply: what it hears first must not turn it on. One that
        reports an error, and so has no current, is only asked, because "stopped" would clear the error.
        """
        wanted = self.options.sign * checked_torque(torque, self.rated_torque)
        self._unanswered += 1
        if self._unanswered > UNANSWERED:
            self._enabled = False
        if not self._enabled:
            return (self._frame(registers.query_command() if self._failed else registers.stop_command()),)
        return (self._frame(registers.torque_command(wanted, self._limit, self.options.watchdog_s)),)

    def commanded(self, frame: Frame) -> float | None:
        """Torque fed forward of a command; zero of a stop."""
        if frame.key not in self.command_identifiers or not frame.fd:
            return None
        found = registers.registers_of(frame.data)
        if found is None or registers.MODE not in found.writes:
            return None
        return self.options.sign * found.writes.get(registers.TORQUE, 0.0)

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """Status and sample of an answer."""
        if frame.key not in self.reply_identifiers:
            return ()
        report = registers.report_of(frame.data) if frame.fd and not frame.remote else None
        if report is None:
            return (Rejected("not the answer to our query"),)
        if not all(map(math.isfinite, report)):
            return (Rejected("a value is not finite"),)
        if not 0 <= report.mode <= _LAST_MODE or report.fault < 0:
            return (Rejected(f"no such mode {report.mode} or fault {report.fault}"),)
        sign, zero = self.options.sign, self.options.zero
        self._unanswered = 0
        self._failed = report.mode in (registers.FAULTED, registers.TIMEOUT)
        if report.mode not in _STARTING:
            self._enabled = self._enabled and report.mode == registers.POSITION_MODE
        sample = Sample(sign * (TURN * report.position - zero), sign * TURN * report.velocity, sign * report.torque)
        checked = believed(sample)
        if isinstance(checked, Rejected):
            return (checked,)
        return status_of(report), checked

    def poll_frames(self) -> tuple[Frame, ...]:
        """The query alone: it commands nothing, nor does it feed the watchdog."""
        return (self._frame(registers.query_command()),)

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Stop, which clears a fault or a timeout; then position mode with zero torque."""
        if status.state == "error":
            return self._stopping()
        self._enabled, self._unanswered = True, 0
        return self.torque_frames(0.0) if status.state == "off" else ()

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Stop; the drive has no state between."""
        frames = self._stopping()
        return () if status.state == "off" else frames

    def stop_frames(self) -> tuple[Frame, ...]:
        """Stop: no current from the next control cycle of the drive on."""
        return self._stopping()

    def _stopping(self) -> tuple[Frame, ...]:
        self._enabled = False
        return (self._frame(registers.stop_command()),)

    def _frame(self, data: bytes) -> Frame:
        return Frame((HOST | REPLY) << 8 | self.options.node, data, extended=True, fd=True)


def status_of(report: registers.Report) -> DriveStatus:
    """State and faults; a mode in which the motor has current but that we never ask for is an error."""
    state = _STATES.get(report.mode)
    if state is None:
        return DriveStatus("error", (f"mode {report.mode}, not asked for",), f"mode {report.mode}")
    if report.mode == registers.TIMEOUT:
        return DriveStatus("error", ("watchdog",), "timeout")
    if report.mode == registers.FAULTED or (report.fault and report.fault not in _LIMITING):
        return DriveStatus("error", (FAULTS.get(report.fault, f"fault {report.fault}"),), f"mode {report.mode}")
    limit = f", limit {report.fault}" if report.fault else ""
    return DriveStatus(state, (), f"mode {report.mode}{limit}")


def _keys(identifiers: list[int]) -> frozenset[tuple[int, bool]]:
    """Keys of identifiers; where 11 bits are enough the drive does not care which form a frame has."""
    extended = {(identifier, True) for identifier in identifiers}
    return frozenset(extended | {(identifier, False) for identifier in identifiers if identifier <= 0x7FF})
