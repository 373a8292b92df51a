"""CANopen drives in cyclic synchronous torque (CiA 402, mode 10): one PDO and a SYNC per cycle.

The PDO map is the one of ``cia402.dbc`` and must be set in the drive beforehand (``cia402_setup.py`` does it with the
canopen library, over SDO, while the drive is disabled). The cyclic frames are made here and not by that library, which
would send them from a thread or the kernel on its own clock.

The drive's own torque limit is object 0x6072, written and read back over SDO (expedited transfers of CiA 301) when the
drive is brought up.

Torque is in per mille of the drive's rated torque. Object 0x6076 holds it in mN m by the profile, but some makers put a
current there: so ``rated_torque`` must be given. The watchdog differs per maker and is set with the drive's own tools;
nothing is assumed about it here. Velocity has a maker's unit too: without ``rate_unit`` rates are nan.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import (
    NAN,
    RATE_LIMIT,
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

CYCLIC_SYNCHRONOUS_TORQUE = 10
DISABLE_VOLTAGE, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, FAULT_RESET = 0x00, 0x06, 0x07, 0x0F, 0x80
NMT_START = 0x01
MAX_TORQUE = 0x6072
# Expedited SDO transfers: the first byte of what we send, and of what comes (its upper three bits).
SDO_WRITE_2, SDO_READ, SDO_WRITTEN, SDO_CONTENT, SDO_ABORT = 0x2B, 0x40, 0x60, 0x40, 0x80
# (mask, value, the profile's name, our state); the first that fits.
STATUS_WORDS: tuple[tuple[int, int, str, DriveState], ...] = (
    (0x4F, 0x00, "not ready to switch on", "off"),
    (0x4F, 0x40, "switch on disabled", "off"),
    (0x6F, 0x21, "ready to switch on", "ready"),
    (0x6F, 0x23, "switched on", "ready"),
    (0x6F, 0x27, "operation enabled", "on"),
    (0x6F, 0x07, "quick stop active", "ready"),
    (0x4F, 0x0F, "fault reaction active", "error"),
    (0x4F, 0x08, "fault", "error"),
)
_SDO = struct.Struct("<BHBI")
NMT_STATES = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
# From a state to the control word that leads on.
_UP = {
    "switch on disabled": SHUTDOWN,
    "ready to switch on": SWITCH_ON,
    "switched on": ENABLE_OPERATION,
    "quick stop active": DISABLE_VOLTAGE,
}


@dataclass(frozen=True)
class Cia402Options(Options):
    """``rated_torque`` (what per mille are of) and ``increments_per_turn`` must be given.

    ``rate_unit`` in rad/s is one step of object 0x606C.
    """

    node: int = 1
    increments_per_turn: int = 0
    rate_unit: float = NAN


class Cia402:
    """A ``Motor``. The control word goes with each torque, so the last one asked for is kept here."""

    name = "cia402"
    bitrate, data_bitrate, counter_modulus = 1_000_000, 0, 0
    own_limit: OwnLimit = "told"
    asking_identifiers: frozenset[tuple[int, bool]] = frozenset()

    def __init__(self, options: Cia402Options) -> None:
        self.rated_torque = checked_options(options, self.name, range(1, 128))
        if options.increments_per_turn <= 0:
            raise InputError("motor cia402", "increments_per_turn is missing", "give the encoder's increments per turn")
        self.options = options
        self._dbc = dbc("cia402")
        self._control, self._rate = DISABLE_VOLTAGE, NAN
        offset = options.node - 1
        names = ("Emergency", "TransmitPdo1", "TransmitPdo2", "Heartbeat")
        self._replies = {(self._dbc.identifier(name) + offset, False): name for name in names}
        self._limit_written = False
        self.reply_identifiers = frozenset(self._replies)
        receive_pdos = [base + options.node for base in (0x200, 0x300, 0x400, 0x500)]
        commands = (0x000, 0x080, *receive_pdos, 0x600 + options.node)
        self.command_identifiers = frozenset((identifier, False) for identifier in commands)

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """Write the limit in per mille of the rated torque; once that is answered, ask for it."""
        share = math.floor(1000.0 * min(torque, self.rated_torque) / self.rated_torque + 1e-9)
        first, content = (SDO_READ, 0) if self._limit_written else (SDO_WRITE_2, share)
        return (Frame(0x600 + self.options.node, _SDO.pack(first, MAX_TORQUE, 0, content)),)

    def told_limit(self, frame: Frame) -> float | None:
        """From the answer to a reading; a drive that refuses to have the limit written may still tell it."""
        if frame.key != (0x580 + self.options.node, False) or frame.remote or len(frame.data) != _SDO.size:
            return None
        first, index, sub, content = _SDO.unpack(frame.data)
        told, refused = first & 0xE2 == SDO_CONTENT | 0x02, first == SDO_ABORT  # 0x02: the content is in the frame
        if (index, sub) != (MAX_TORQUE, 0):
            return None
        if not self._limit_written:
            self._limit_written = refused or first == SDO_WRITTEN
            return None
        if not (told or refused):
            return None
        self._limit_written = False
        return (content & 0xFFFF) / 1000.0 * self.rated_torque if told else NAN

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """Control word, torque and mode, then the SYNC at which they act and the drive answers."""
        share = self.options.sign * checked_torque(torque, self.rated_torque) / self.rated_torque
        return (*self._control_frames(self._control, share), self._sync())

    def commanded(self, frame: Frame) -> float | None:
        """Torque of a PDO 1."""
        key = (self._dbc.identifier("ReceivePdo1") + self.options.node - 1, False)
        if frame.key != key or frame.remote or len(frame.data) != self._dbc.length("ReceivePdo1"):
            return None
        return self.options.sign * self._dbc.decode("ReceivePdo1", frame.data)["Torque"] * self.rated_torque

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """Status and sample of PDO 1; rate from PDO 2 in the next sample; emergencies and the node's state."""
        name = self._replies.get(frame.key)
        if name is None:
            return ()
        if frame.remote or frame.fd or len(frame.data) != self._dbc.length(name):
            return (Rejected(f"{name} is not a classic data frame of {self._dbc.length(name)} bytes"),)
        values = self._dbc.decode(name, frame.data)
        if name == "TransmitPdo1":
            return self._sample(values)
        if name == "TransmitPdo2":
            return self._mode_and_rate(values)
        if name == "Emergency":
            code = int(values["ErrorCode"])
            return (DriveStatus("error", (f"emergency 0x{code:04X}",), "emergency"),) if code else ()
        node_state = NMT_STATES.get(int(values["State"]))
        if node_state is None:
            return (Rejected(f"no such node state 0x{int(values['State']):02X}"),)
        return () if node_state == "operational" else (DriveStatus("off", (), node_state),)

    def poll_frames(self) -> tuple[Frame, ...]:
        """A SYNC: the drive sends its PDOs."""
        return (self._sync(),)

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """The node to operational, a fault reset by its rising edge, then the profile's path to operation enabled."""
        if status.detail in NMT_STATES.values():
            start = {"Command": NMT_START, "Node": self.options.node}
            return (Frame(self._dbc.identifier("Nmt"), self._dbc.encode("Nmt", start)), self._sync())
        if status.state == "error":
            self._control = DISABLE_VOLTAGE
            edge = (*self._control_frames(DISABLE_VOLTAGE, 0.0), self._sync())
            return (*edge, *self._control_frames(FAULT_RESET, 0.0), self._sync())
        if status.detail not in _UP:
            return ()
        self._control = _UP[status.detail]
        return self.torque_frames(0.0)

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Zero torque with "switched on", then "disable voltage"."""
        if status.state == "off":
            self._control = DISABLE_VOLTAGE
            return ()
        self._control = SWITCH_ON if status.state == "on" else DISABLE_VOLTAGE
        return self.torque_frames(0.0)

    def stop_frames(self) -> tuple[Frame, ...]:
        """Zero torque and "disable voltage" in one frame."""
        self._control = DISABLE_VOLTAGE
        return self.torque_frames(0.0)

    def _control_frames(self, control: int, share: float) -> tuple[Frame, ...]:
        values = {"ControlWord": control, "Torque": share, "Mode": CYCLIC_SYNCHRONOUS_TORQUE}
        identifier = self._dbc.identifier("ReceivePdo1") + self.options.node - 1
        return (Frame(identifier, self._dbc.encode("ReceivePdo1", values)),)

    def _sync(self) -> Frame:
        return Frame(self._dbc.identifier("Sync"), b"")

    def _sample(self, values: dict[str, float]) -> tuple[Message, ...]:
        word = int(values["StatusWord"])
        found = [(name, state) for mask, value, name, state in STATUS_WORDS if word & mask == value]
        if not found:
            return (Rejected(f"no such status word 0x{word:04X}"),)
        name, state = found[0]
        sign = self.options.sign
        angle = 2.0 * math.pi * values["Position"] / self.options.increments_per_turn - self.options.zero
        rate, self._rate = self._rate, NAN
        sample = believed(Sample(sign * angle, rate, sign * values["Torque"] * self.rated_torque))
        if isinstance(sample, Rejected):
            return (sample,)
        return DriveStatus(state, ("fault",) if state == "error" else (), name), sample

    def _mode_and_rate(self, values: dict[str, float]) -> tuple[Message, ...]:
        mode = int(values["Mode"])
        if mode not in (0, CYCLIC_SYNCHRONOUS_TORQUE):
            return (DriveStatus("error", (f"mode {mode}, not asked for",), "mode"),)
        rate = self.options.sign * values["Velocity"] * self.options.rate_unit
        if abs(rate) > RATE_LIMIT:
            return (Rejected(f"rate {rate:g} rad/s"),)
        self._rate = rate
        return ()
