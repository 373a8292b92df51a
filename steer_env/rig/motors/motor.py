"""What every motor offers: torque in N m to frames, frames to samples and states.

Sign, zero and units are set here and nowhere else: angles in rad with 0 straight ahead, rates in rad/s, torques in N m
at the motor's shaft, all positive to the left. A motor object belongs to one drive and keeps no time: limits, ages and
deadlines are the safety layer's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from steer_env.errors import InputError
from steer_env.rig.frame import Frame

NAN = float("nan")
DriveState = Literal["off", "ready", "on", "error"]


class Sample(NamedTuple):
    """What a drive measured; nan (counter -1) where its protocol does not have the value.

    ``torque`` is the motor's torque in N m as the drive believes it, ``sensor_torque`` what a torque sensor between
    motor and wheel reads in N m, positive where the wheel drives the motor (as the torsion bar's torque).
    """

    angle: float
    rate: float = NAN
    torque: float = NAN
    sensor_torque: float = NAN
    counter: int = -1


class DriveStatus(NamedTuple):
    """State of the drive, and the names of its error bits that are set."""

    state: DriveState
    faults: tuple[str, ...] = ()
    detail: str = ""  # the drive's own name of its state


class Rejected(NamedTuple):
    """A frame with an identifier of this drive that cannot be believed; the reason in a few words."""

    reason: str


Message = Sample | DriveStatus | Rejected
OwnLimit = Literal["told", "set", "none"]


@dataclass(frozen=True)
class Options:
    """What is set once per rig; each motor's own Options adds to these.

    ``sign`` is 1 or -1: the drive's positive direction against left. ``zero`` in rad, in the drive's own direction, is
    its angle when the wheel is straight. ``rated_torque`` in N m is the most that is ever commanded; drives whose
    protocol does not tell it (None here) must be given it.
    """

    node: int = 0
    sign: int = 1
    zero: float = 0.0
    rated_torque: float | None = None


class Motor(Protocol):
    """A drive as seen from the host. Build one by ``steer_env.rig.motors.make``."""

    name: str
    rated_torque: float  # N m: the drive's rating; ``torque_frames`` takes no more
    bitrate: int  # bit/s, what the drive expects unless it was configured otherwise
    data_bitrate: int  # bit/s of the data phase, 0: classic CAN
    counter_modulus: int  # samples count 0 .. modulus - 1; 0: the protocol has no counter
    # Of the drive's own torque limit: set by ``limit_frames`` and told by the drive, set without an answer, or none.
    own_limit: OwnLimit
    # (identifier, extended) that only we may send: one that comes in from the bus was injected.
    command_identifiers: frozenset[tuple[int, bool]]
    # (identifier, extended) that only the drive sends.
    reply_identifiers: frozenset[tuple[int, bool]]
    # (identifier, extended) of which an empty or remote frame, which asks, is taken by the drive for life of its host.
    asking_identifiers: frozenset[tuple[int, bool]]

    def limit_frames(self, torque: float) -> tuple[Frame, ...]:
        """Frames that give the drive a torque limit of its own in N m, rounded down; () where others carry it, or none.

        It is the last thing between a command that was damaged on its way and the motor. From now on every frame that
        has a field for it carries it. Where ``own_limit`` is "told", call it again until a frame has told the limit.
        """

    def told_limit(self, frame: Frame) -> float | None:
        """The most torque in N m that the drive gives, if a frame tells it; nan: it says that it has no such limit."""

    def torque_frames(self, torque: float) -> tuple[Frame, ...]:
        """Frames that command a torque in N m and ask for the next sample; the only way to command torque.

        They never turn a drive on: before ``bring_up`` asked for it and after ``bring_down`` they can only say zero.
        Raises ValueError for a torque that is not finite or beyond ``rated_torque``.
        """

    def commanded(self, frame: Frame) -> float | None:
        """Torque in N m that a frame asks the drive for, as ``torque_frames`` wrote it; None: it asks for none."""

    def decode(self, frame: Frame) -> tuple[Message, ...]:
        """What a frame says: () if it is not from this drive, ``Rejected`` if it cannot be believed.

        A frame may hold a sample and a status. A value is nan only where the protocol does not have it.
        """

    def poll_frames(self) -> tuple[Frame, ...]:
        """Frames that ask for status and sample and command nothing; () where the drive sends them by itself."""

    def bring_up(self, status: DriveStatus) -> tuple[Frame, ...]:
        """The one next transition towards "on" from an observed status, errors cleared first; () when on.

        Call it once per status received: a drive that has not answered yet is not asked twice.
        """

    def bring_down(self, status: DriveStatus) -> tuple[Frame, ...]:
        """The one next transition towards "off" from an observed status, zero torque first; () when off."""

    def stop_frames(self) -> tuple[Frame, ...]:
        """Zero torque and the fastest way to a drive without current, whatever its state; may be repeated."""


# Beyond these no steering wheel is: a sample that says so is a fault of the encoder or of the frame.
ANGLE_LIMIT = 1000.0  # rad, 159 turns
RATE_LIMIT = 1000.0  # rad/s
TORQUE_LIMIT = 100.0  # N m


def believed(sample: Sample) -> Sample | Rejected:
    """The sample, or why it cannot be one of a steering wheel; nan stands for a value that the protocol has not."""
    if not abs(sample.angle) <= ANGLE_LIMIT:
        return Rejected(f"angle {sample.angle:g} rad")
    if abs(sample.rate) > RATE_LIMIT:
        return Rejected(f"rate {sample.rate:g} rad/s")
    if abs(sample.torque) > TORQUE_LIMIT or abs(sample.sensor_torque) > TORQUE_LIMIT:
        return Rejected(f"torque {sample.torque:g} or {sample.sensor_torque:g} N m")
    return sample


def checked_torque(torque: float, rated_torque: float) -> float:
    """The torque itself; ValueError if it is not finite or beyond the rating in N m."""
    if not math.isfinite(torque):
        raise ValueError(f"torque {torque} is not finite")
    if abs(torque) > rated_torque:
        raise ValueError(f"torque {torque:g} N m is beyond the drive's {rated_torque:g} N m")
    return torque


def checked_options(options: Options, motor: str, nodes: range) -> float:
    """Check what all motors share and return the rated torque in N m; raises InputError."""
    where = f"motor {motor}"
    if options.sign not in (1, -1):
        raise InputError(where, f"sign is {options.sign}", "give 1 or -1")
    if not math.isfinite(options.zero):
        raise InputError(where, f"zero is {options.zero}", "give the drive's angle at straight ahead in rad")
    if options.node not in nodes:
        raise InputError(where, f"node is {options.node}", f"give a node from {nodes[0]} to {nodes[-1]}")
    rated = options.rated_torque
    if rated is None:
        raise InputError(where, "rated_torque is missing", "give the drive's rated torque in N m; its bus does not")
    if not (math.isfinite(rated) and 0.0 < rated <= 50.0):
        raise InputError(where, f"rated_torque is {rated} N m", "give a torque above 0 and up to 50 N m")
    return rated
