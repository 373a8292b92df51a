"""SENSODRIVE SENSO-Wheel (firmware 3.06 and later), normal mode: a force-feedback wheel with 11-bit request and answer.

Known from several independent drivers: the frames of ``senso_wheel.dbc``. Known to nobody: the time of the drive's CAN
watchdog (10 ms between frames is short enough; ``steer-env rig check`` measures it), which is therefore never switched
off and never counted on. The nominal torque of 7.5 N m and 40 000 increments a turn are the maker's fall-back values.
Whether the torque in the answer is measured or commanded is unknown; it is no shaft sensor. The speed has steps of
1 rpm (0.105 rad/s). The angle is relative until the drive has made its reference tour, in which it turns the wheel by
itself; that tour is never asked for here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.motors.dbc import dbc
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

NOMINAL_TORQUE = 7.5  # N m
OFF, READY, ON, ERROR, QUIT_ERROR = 0x0, 0x2, 0x4, 0x8, 0xF
NORMAL = 0x1
MODES = {0x0: "none", NORMAL: "normal", 0x2: "basic", 0x4: "reference tour", 0x8: "demo"}
STATES: dict[int, DriveState] = {OFF: "off", READY: "ready", ON: "on", ERROR: "error"}
FAULTS = {
    0x0001: "overcurrent",
    0x0002: "overvoltage",
    0x0004: "undervoltage",
    0x0008: "power stage overtemperature",
    0x0010: "hall",
    0x0020: "CAN bus error",
    0x0040: "hall and encoder swapped",
    0x0080: "CAN watchdog",
    0x0100: "illegal position",
    0x0200: "switched on outside end stop",
    0x0400: "referencing timeout",
    0x0800: "brake chopper overtemperature",
    0x2000: "hardware",
    0x4000: "update 0x4000",
    0x8000: "update 0x8000",
}
FIRMWARE_UPDATE = 0x010
# All that a host can send to the drive; 0x010 nobody may send.
HOST_IDENTIFIERS = (FIRMWARE_UPDATE, *range(0x200, 0x210), 0x221, 0x22A, 0x22D)


@dataclass(frozen=True)
class SensoOptions(Options):
    """Options of the drive; limits in per cent of its ``nominal_torque`` in N m, end stop in deg (below 10: off).

    ``torque_limit_percent`` is the most; what is sent is lower where the safety layer's cap is.
    """

    rated_torque: float | None = NOMINAL_TORQUE
    nominal_torque: float = NOMINAL_TORQUE
    increments_per_turn: int = 40_000
    end_stop_deg: int = 540
    torque_limit_percent: int = 100
    peak_limit_percent: int = 100


class SensoWheel:
    """A ``Motor``. The drive answers each frame by one 0x10 higher and sends nothing by itself."""

    name = "senso_wheel"
    bitrate, data_bitrate, counter_modulus = 1_000_000, 0, 0
    own_limit: OwnLimit = "set"
    asking_identifiers: frozenset[tuple[int, bool]] = frozenset()

    def __init__(self, options: SensoOptions) -> None:
        self.rated_torque = checked_options(options, self.name, range(1))
        if options.increments_per_turn <= 0:
            raise InputError(
                "motor senso_wheel", "increments_per_turn is not positive", "read it from the drive: 40000 or 8000"
            )
        if not (0 <= options.end_stop_deg <= 1440 and 0 <= options.torque_limit_percent <= 255):
            raise InputError("motor senso_wheel", "end stop or torque limit is out of range", "0..1440 deg, 0..255 %")
        if not 0.0 < options.nominal_torque <= 50.0:
            raise InputError("motor senso_wheel", "nominal_torque is out of range", "give the drive's in N m, up to 50")
        if not 0 <= options.peak_limit_percent <= 100:
            raise InputError("motor senso_wheel", "peak_limit_percent is out of range", "0..100 %")
        self.options = options
        self._dbc = dbc("senso_wheel")
        self._unit = options.sign * 2.0 * math.pi / options.increments_per_turn  # rad per increment, left positive
        self._asked = OFF
        self._percent = options.torque_limit_percent
        self.command_identifiers = frozenset((identifier, False) for identifier in HOST_IDENTIFIERS)
        self.reply_identifiers = frozenset((self._dbc.identifier(name), False) for name in ("Status", "NormalAnswer"))

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """The state last asked for, once more, with the limit in whole per cent of the nominal torque."""
        percent = math.floor(100.0 * torque / self.options.nominal_torque + 1e-9)
        self._percent = min(max(percent, 1), self.options.torque_limit_percent)
        return (self._control(self._asked),)

    def told_limit(self, frame: Frame) -> float | None:
        """Never told."""
        return None

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """One 0x201 with friction, damping and stiffness zero; it does not change the drive's state."""
        wanted = self.options.sign * checked_torque(torque, self.rated_torque)
        values = {"Torque": wanted, "Friction": 0.0, "Damping": 0.0, "Stiffness": 0.0}
        return (Frame(self._dbc.identifier("NormalCommand"), self._dbc.encode("NormalCommand", values)),)

    def commanded(self, frame: Frame) -> float | None:
        """Torque of a 0x201."""
        if frame.key != (self._dbc.identifier("NormalCommand"), False) or frame.remote or len(frame.data) != 8:
            return None
        return self.options.sign * self._dbc.decode("NormalCommand", frame.data)["Torque"]

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """A sample from 0x211, a status from 0x210."""
        if frame.key not in self.reply_identifiers:
            return ()
        if frame.remote or frame.fd or len(frame.data) != 8:
            return (Rejected(f"0x{frame.identifier:X} is not a classic data frame of 8 bytes"),)
        if frame.identifier == self._dbc.identifier("NormalAnswer"):
            values = self._dbc.decode("NormalAnswer", frame.data)
            drive_zero = self.options.sign * self.options.zero
            angle, sign = self._unit * values["Position"] - drive_zero, self.options.sign
            return (believed(Sample(angle, sign * values["Speed"], sign * values["Torque"])),)
        values = self._dbc.decode("Status", frame.data)
        state, mode = STATES.get(int(values["State"])), MODES.get(int(values["Mode"]))
        if state is None or mode is None:
            return (Rejected(f"no such state 0x{frame.data[0]:02X}"),)
        return (DriveStatus(state, faults_of(int(values["Errors"])), mode),)

    def poll_frames(self) -> tuple[Frame, ...]:
        """The state last asked for, once more, and a torque of zero: a status and a sample come back."""
        return (self._control(self._asked), *self.torque_frames(0.0))

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """QUIT ERROR, OFF to READY, READY to ON; the mode is set in READY."""
        if status.state == "error":
            return (self._control(QUIT_ERROR),)
        if status.state == "off" or (status.state == "ready" and status.detail != MODES[NORMAL]):
            return self._asking(READY)
        if status.state == "ready":
            return (*self.torque_frames(0.0), *self._asking(ON))
        return ()

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Zero torque and ON to READY, READY to OFF."""
        if status.state == "on":
            return (*self.torque_frames(0.0), *self._asking(READY))
        if status.state == "off":
            return ()
        return self._asking(OFF)

    def stop_frames(self) -> tuple[Frame, ...]:
        """Zero torque, READY, OFF, back to back."""
        return (*self.torque_frames(0.0), *self._asking(READY), *self._asking(OFF))

    def _asking(self, transition: int) -> tuple[Frame, ...]:
        self._asked = transition
        return (self._control(transition),)

    def _control(self, transition: int) -> Frame:
        values = {
            "Transition": transition,
            "Mode": NORMAL,
            "WatchdogOff": 0,  # forbidden in normal operation
            "EndStopVibration": 0,
            "FrictionVersion2": 0,
            "EndStop": self.options.end_stop_deg,
            "PositionOffset": 0,
            "TorqueLimit": self._percent,
            "PeakTorqueLimit": self.options.peak_limit_percent,
        }
        return Frame(self._dbc.identifier("Control"), self._dbc.encode("Control", values))


def faults_of(errors: int) -> tuple[str, ...]:
    """Names of the error bits that are set; a bit without a name is a fault too."""
    return tuple(FAULTS.get(1 << bit, f"error bit {bit}") for bit in range(16) if errors >> bit & 1)
