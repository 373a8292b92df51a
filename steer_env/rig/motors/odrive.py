"""ODrive over CANSimple: firmware 0.5 (v3.6) and 0.6 (Pro, S1, Micro), whose layouts differ in a few frames.

The drive must be configured beforehand: CAN bit rate (250 kbit/s by default: too slow for 1 kHz), the encoder estimates
every 1 ms, its torque constant and, because it is off by default, its watchdog; 0.5 feeds that with any frame addressed
to the node (any identifier of its 32, whoever sends it), 0.6 with the cyclic setpoint. None of these can be read here.
The drive sends by itself. Its current and speed limits can be set over the bus, both at once, and not be read back.
Torque is the motor's; 0.5 sends only currents, so there it is nan. Calibration, in which the motor turns by itself, is
never asked for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.motors.dbc import dbc
from steer_env.rig.motors.motor import (
    NAN,
    RATE_LIMIT,
    TORQUE_LIMIT,
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

IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, PASSTHROUGH = 1, 1
# Numbers of the axis states of both firmwares (odrive_enums.h); 5 was sensorless control in 0.5.
AXIS_STATES = {
    0: "undefined",
    IDLE: "idle",
    2: "startup sequence",
    3: "full calibration",
    4: "motor calibration",
    5: "sensorless control",
    6: "encoder index search",
    7: "encoder offset calibration",
    CLOSED_LOOP: "closed loop control",
    9: "lockin spin",
    10: "encoder direction find",
    11: "homing",
    12: "encoder hall polarity calibration",
    13: "encoder hall phase calibration",
    14: "anticogging calibration",
}
FAULTS = {
    "0.5": {0x1: "invalid state", 0x800: "watchdog", 0x4000: "estop"},
    "0.6": {
        0x1: "initializing",
        0x2: "system level",
        0x4: "timing",
        0x8: "missing estimate",
        0x10: "bad config",
        0x20: "gate driver",
        0x40: "missing input",
        0x100: "overvoltage",
        0x200: "undervoltage",
        0x400: "overcurrent of the supply",
        0x800: "regeneration overcurrent",
        0x1000: "current limit",
        0x2000: "motor overtemperature",
        0x4000: "inverter overtemperature",
        0x8000: "velocity limit",
        0x10000: "position limit",
        0x1000000: "watchdog",
        0x2000000: "estop",
        0x4000000: "spinout",
        0x8000000: "brake resistor disarmed",
        0x10000000: "thermistor disconnected",
        0x40000000: "calibration",
    },
}
ESTOP = 0x02  # anybody may send it
HOST_COMMANDS = (0x04, 0x05, 0x06, 0x07, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x11, 0x12, 0x13, 0x16, 0x18, 0x19, 0x1A, 0x1B)

# 0.5 takes any frame of its node for life, also one without a meaning; what the drive sends itself is left out.
HOST_COMMANDS_05 = tuple(k for k in range(32) if k not in (0x01, ESTOP, 0x03, 0x09, 0x0A, 0x14, 0x15, 0x17, 0x1C, 0x1D))


@dataclass(frozen=True)
class OdriveOptions(Options):
    """``rated_torque`` must be given: what the motor on this drive may give.

    ``torque_constant`` in N m/A and ``rate_limit`` in rad/s let the drive have a torque limit of its own: one message
    sets current and speed limit together, so both are needed. The drive fades the torque towards its speed limit with
    its velocity gain (unless ``enable_torque_mode_vel_limit`` is off): one that is too low weakens the motor at rest.
    """

    firmware: str = "0.6"
    torque_constant: float | None = None
    rate_limit: float | None = None


class Odrive:
    """A ``Motor``."""

    data_bitrate, counter_modulus = 0, 0
    bitrate = 1_000_000  # configured; as delivered it is 250 000

    def __init__(self, options: OdriveOptions) -> None:
        if options.firmware not in FAULTS:
            raise InputError("motor odrive", f"firmware is {options.firmware!r}", 'give "0.5" or "0.6"')
        self.name = {"0.5": "odrive_05", "0.6": "odrive"}[options.firmware]
        self.rated_torque = checked_options(options, self.name, range(64))
        self.options = options
        self._dbc = dbc({"0.5": "odrive_05", "0.6": "odrive_06"}[options.firmware])
        self._base = options.node << 5
        self._torque = NAN
        commands = HOST_COMMANDS if options.firmware == "0.6" else HOST_COMMANDS_05
        self.command_identifiers = frozenset((self._base | command, False) for command in commands)
        asking = set() if options.firmware == "0.6" else set(range(32)) - {*commands, ESTOP}
        self.asking_identifiers = frozenset((self._base | command, False) for command in asking)
        self.own_limit: OwnLimit = self._checked_limits()
        replies = [message for message in ("Heartbeat", "EncoderEstimates", "Torques") if message in self._dbc.messages]
        self._replies = {(self._base | self._dbc.identifier(name), False): name for name in replies}
        self.reply_identifiers = frozenset(self._replies)

    def _checked_limits(self) -> OwnLimit:
        constant, rate = self.options.torque_constant, self.options.rate_limit
        if constant is None and rate is None:
            return "none"
        if constant is None or rate is None:
            missing = "torque_constant (N m/A)" if constant is None else "rate_limit (rad/s)"
            raise InputError(f"motor {self.name}", f"{missing} is missing", "one message sets both limits: give both")
        if not (0.0 < constant <= 100.0 and 0.0 < rate <= RATE_LIMIT):
            what = f"torque_constant {constant} N m/A or rate_limit {rate} rad/s is out of range"
            raise InputError(f"motor {self.name}", what, "give values above 0")
        return "set"

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """Current and speed limit."""
        if self.options.torque_constant is None or self.options.rate_limit is None:
            return ()
        current = min(torque, self.rated_torque) / self.options.torque_constant
        return (self._frame("SetLimits", RateLimit=self.options.rate_limit, CurrentLimit=current),)

    def told_limit(self, frame: Frame) -> float | None:
        """Never told."""
        return None

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """One input torque; it does nothing unless the axis is in closed loop."""
        wanted = self.options.sign * checked_torque(torque, self.rated_torque)
        return (self._frame("SetInputTorque", Torque=wanted),)

    def commanded(self, frame: Frame) -> float | None:
        """Torque of an input torque."""
        if frame.key != (self._base | self._dbc.identifier("SetInputTorque"), False) or len(frame.data) != 4:
            return None
        return self.options.sign * self._dbc.decode("SetInputTorque", frame.data)["Torque"]

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """A sample per encoder estimate, with the torque that came since the last one; a status per heartbeat."""
        name = self._replies.get(frame.key)
        if name is None or frame.remote:
            return ()
        if frame.fd or len(frame.data) != 8:
            return () if not frame.data else (Rejected(f"{name} is not a classic frame of 8 bytes"),)
        values = self._dbc.decode(name, frame.data)
        if not all(map(math.isfinite, values.values())):
            return (Rejected(f"{name} has a value that is not finite"),)
        if name == "Heartbeat":
            return (self._status(values),)
        sign = self.options.sign
        if name == "Torques":
            if abs(values["Estimate"]) > TORQUE_LIMIT:
                return (Rejected(f"torque {values['Estimate']:g} N m"),)
            self._torque = sign * values["Estimate"]
            return ()
        torque, self._torque = self._torque, NAN
        return (believed(Sample(sign * (values["Angle"] - self.options.zero), sign * values["Rate"], torque)),)

    def poll_frames(self) -> tuple[Frame, ...]:
        """0.5 answers an empty frame with the message's identifier; 0.6 sends by itself."""
        if self.options.firmware == "0.6":
            return ()
        return tuple(Frame(self._base | self._dbc.identifier(name), b"") for name in ("Heartbeat", "EncoderEstimates"))

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Clear errors; from idle: zero torque, torque control with passthrough, closed loop.

        Raises InputError for node 0 of firmware 0.5: frames of the highest priority, which keep all of ours off the
        bus, would belong to it and keep its watchdog fed.
        """
        if self._base == 0 and self.options.firmware == "0.5":
            what = "node 0 of firmware 0.5: a node that fills the bus with identifiers below 32 keeps its watchdog fed"
            raise InputError("motor odrive_05", what, "give the drive another (axis0.config.can.node_id), and the rig")
        if status.state == "error":
            extra = {} if self.options.firmware == "0.5" else {"Identify": 0}
            return (self._frame("ClearErrors", **extra),)
        if status.state == "off":
            return (
                *self.torque_frames(0.0),
                self._frame("SetControllerMode", ControlMode=TORQUE_CONTROL, InputMode=PASSTHROUGH),
                self._frame("SetAxisState", AxisState=CLOSED_LOOP),
            )
        return ()

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Zero torque and idle."""
        return () if status.state == "off" else self.stop_frames()

    def stop_frames(self) -> tuple[Frame, ...]:
        """Zero torque and idle."""
        return (*self.torque_frames(0.0), self._frame("SetAxisState", AxisState=IDLE))

    def _frame(self, name: str, **values: float) -> Frame:
        return Frame(self._base | self._dbc.identifier(name), self._dbc.encode(name, values))

    def _status(self, values: dict[str, float]) -> Message:
        state, errors = AXIS_STATES.get(int(values["AxisState"])), int(values["AxisError"])
        if state is None or (self.options.firmware == "0.6" and values["ProcedureResult"] > 15):
            return Rejected(f"no such axis state {int(values['AxisState'])} or procedure result")
        names = FAULTS[self.options.firmware]
        faults = [names.get(1 << bit, f"error bit {bit}") for bit in range(32) if errors >> bit & 1]
        flags = ("MotorErrorFlag", "EncoderErrorFlag", "ControllerErrorFlag")
        faults += [flag for flag in flags if values.get(flag)]
        kinds: dict[str, DriveState] = {"undefined": "off", "idle": "off", "closed loop control": "on"}
        return DriveStatus("error" if faults else kinds.get(state, "ready"), tuple(faults), state)
