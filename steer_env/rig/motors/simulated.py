"""A motor that exists in simulation only: torque sensor, counters and checksums, and the least protocol that has them.

The wheel that a careful maker would build for haptic control: each command and each answer carries a counter and a CRC,
and the answer a torque sensor's value, which none of the other drives has. Scales are those of ``simulated.dbc``.
"""

from __future__ import annotations

from dataclasses import dataclass

from steer_env.rig.frame import Frame
from steer_env.rig.motors import e2e
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

OFF, READY, ON, ERROR, QUIT_ERROR = 0, 1, 2, 3, 4
STATES: dict[int, DriveState] = {OFF: "off", READY: "ready", ON: "on", ERROR: "error"}
FAULTS = (
    "watchdog", "overcurrent", "undervoltage", "overtemperature", "encoder", "torque sensor", "checksum", "counter",
)  # fmt: skip


@dataclass(frozen=True)
class SimulatedOptions(Options):
    """The rating is the steer-by-wire plant's."""

    rated_torque: float | None = 7.5


class Simulated:
    """A ``Motor``. The drive answers each command with its motion and then a sample of the same counter."""

    name = "simulated"
    bitrate, data_bitrate, counter_modulus = 1_000_000, 0, e2e.MODULUS
    own_limit: OwnLimit = "none"  # its commands carry a checksum
    asking_identifiers: frozenset[tuple[int, bool]] = frozenset()

    def __init__(self, options: SimulatedOptions) -> None:
        self.rated_torque = checked_options(options, self.name, range(1))
        self.options = options
        self._dbc = dbc("simulated")
        self._request, self._counter = OFF, 0
        self._motion: dict[str, float] | None = None
        self._replies = {(self._dbc.identifier(name), False): name for name in ("Motion", "Sample")}
        self.reply_identifiers = frozenset(self._replies)
        self.command_identifiers = frozenset({(self._dbc.identifier("Command"), False)})

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """The protocol has none."""
        return ()

    def told_limit(self, frame: Frame) -> float | None:
        """Never told."""
        return None

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """One command with the state last asked for."""
        return (self._command(self._request, checked_torque(torque, self.rated_torque)),)

    def commanded(self, frame: Frame) -> float | None:
        """Torque of an intact command."""
        if frame.key not in self.command_identifiers or len(frame.data) != self._dbc.length("Command"):
            return None
        if not e2e.intact(frame.data, frame.identifier):
            return None
        return self.options.sign * self._dbc.decode("Command", frame.data)["Torque"]

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """Status and sample; rate and motor torque are those of the motion with the same counter."""
        name = self._replies.get(frame.key)
        if name is None:
            return ()
        if frame.remote or frame.fd or len(frame.data) != self._dbc.length(name):
            return (Rejected(f"{name} is not a classic data frame of {self._dbc.length(name)} bytes"),)
        if not e2e.intact(frame.data, frame.identifier):
            return (Rejected("checksum"),)
        values = self._dbc.decode(name, frame.data)
        if name == "Motion":
            self._motion = values
            return ()
        state, sign = STATES.get(int(values["State"])), self.options.sign
        if state is None:
            return (Rejected(f"no such state {int(values['State'])}"),)
        sample = Sample(
            sign * (values["Angle"] - self.options.zero),
            sensor_torque=sign * values["SensorTorque"],
            counter=int(values["Counter"]),
        )
        if self._motion is not None and self._motion["Counter"] == values["Counter"]:
            sample = sample._replace(rate=sign * self._motion["Rate"], torque=sign * self._motion["Torque"])
        self._motion = None
        checked = believed(sample)
        if isinstance(checked, Rejected):
            return (checked,)
        bits = int(values["Faults"])
        return DriveStatus(state, tuple(name for k, name in enumerate(FAULTS) if bits >> k & 1)), checked

    def poll_frames(self) -> tuple[Frame, ...]:
        """A command of zero torque with the state last asked for."""
        return self.torque_frames(0.0)

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Quit the error; OFF to READY, READY to ON."""
        if status.state == "error":
            self._request = OFF
            return (self._command(QUIT_ERROR, 0.0),)
        if status.state == "on":
            return ()
        return self._asking(READY if status.state == "off" else ON)

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """Zero torque and ON to READY, READY to OFF."""
        if status.state == "off":
            self._request = OFF
            return ()
        return self._asking(READY if status.state == "on" else OFF)

    def stop_frames(self) -> tuple[Frame, ...]:
        """Zero torque and OFF in one frame."""
        return self._asking(OFF)

    def _asking(self, request: int) -> tuple[Frame, ...]:
        self._request = request
        return self.torque_frames(0.0)

    def _command(self, request: int, torque: float) -> Frame:
        values = {"Crc": 0, "Counter": self._counter, "Request": request, "Torque": self.options.sign * torque}
        self._counter = (self._counter + 1) % e2e.MODULUS
        identifier = self._dbc.identifier("Command")
        return Frame(identifier, e2e.protected(self._dbc.encode("Command", values), identifier))
