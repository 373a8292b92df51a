"""Faults between host and drive, in the wire and in the drive: what each does, when, how often, from a seed.

    VirtualMotor("odrive", rated_torque=2.0, faults=[Fault("loss_to_drive", start=1.0, size=0.3)])

Frames damaged on a real CAN bus are found by its checksum and sent again; corruption and truncation stand for what that
does not see: gateways, adapters, drivers, memory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from steer_env.errors import InputError
from steer_env.rig.frame import Frame

NEVER = math.inf


class Kind(NamedTuple):
    """A fault: what it does, what its ``size`` means, and the size it has if none is given."""

    does: str
    unit: str
    size: float
    low: float = 0.0
    high: float = 1.0


_P = "share of the frames"
FAULTS: dict[str, Kind] = {
    # frames from host to drive
    "loss_to_drive": Kind("frames get lost", _P, 0.3),
    "cut_to_drive": Kind("no frame gets through", "-", 1.0),
    "delay_to_drive": Kind("frames come late", "s", 0.01, 0.0, 10.0),
    "jitter_to_drive": Kind("frames come late by a random time", "s", 0.01, 0.0, 10.0),
    "duplication_to_drive": Kind("frames come twice", _P, 0.5),
    "reordering_to_drive": Kind("frames are overtaken by the next one", _P, 0.5),
    "corruption_to_drive": Kind("one bit of the data is flipped", _P, 0.1),
    "truncation_to_drive": Kind("frames lose their last byte", _P, 0.5),
    # frames from drive to host
    "loss_to_host": Kind("frames get lost", _P, 0.3),
    "cut_to_host": Kind("no frame gets through", "-", 1.0),
    "delay_to_host": Kind("frames come late", "s", 0.01, 0.0, 10.0),
    "jitter_to_host": Kind("frames come late by a random time", "s", 0.01, 0.0, 10.0),
    "duplication_to_host": Kind("frames come twice", _P, 0.5),
    "reordering_to_host": Kind("frames are overtaken by the next one", _P, 0.5),
    "corruption_to_host": Kind("one bit of the data is flipped", _P, 0.1),
    "truncation_to_host": Kind("frames lose their last byte", _P, 0.5),
    "replay_to_host": Kind("the last good frame of each identifier is repeated", "-", 1.0),
    # the bus
    "babbling_node": Kind("a node fills the bus with frames of highest priority", "share of the bus", 1.0),
    "injected_command": Kind("another node repeats our own last command", "frames per s", 200.0, 0.1, 1e4),
    "injected_answer": Kind("another node repeats the drive's last answer", "frames per s", 200.0, 0.1, 1e4),
    "bus_off_host": Kind("our controller is off the bus", "-", 1.0),
    "bus_off_drive": Kind("the drive's controller is off the bus", "-", 1.0),
    # the drive
    "drive_fault": Kind("the drive reports an error and switches off, once", "-", 1.0),
    "power_drop": Kind("the drive has no supply, and starts anew when it is back", "-", 1.0),
    "silent_drive": Kind("the drive obeys and does not answer", "-", 1.0),
    "frozen_counter": Kind("the counter of the answers stands still (where there is one)", "-", 1.0),
    "stuck_sensor": Kind("angle, rate and torques stay what they were", "-", 1.0),
    "sensor_jump": Kind("the angle is off", "rad", 0.5, -100.0, 100.0),
    "sensor_noise": Kind("white noise on the angle", "rad, rms", 0.05, 0.0, 10.0),
    "sensor_not_finite": Kind("the angle is not a number (where the protocol can say so)", "-", 1.0),
    "torque_gain": Kind("the motor gives a multiple of the command", "-", 1.5, -10.0, 10.0),
    "latched_torque": Kind("while on, the drive keeps the torque it had, whatever is commanded", "-", 1.0),
}


class Fault(NamedTuple):
    """One fault from ``start`` for ``duration`` s; ``size`` None: the kind's own."""

    kind: str
    start: float = 0.0
    duration: float = NEVER
    size: float | None = None


def checked(fault: Fault) -> Fault:
    """The fault with its size; raises InputError for an unknown kind or a size out of range."""
    if fault.kind not in FAULTS:
        raise InputError("fault", f"there is no {fault.kind!r}", f"choose from {', '.join(FAULTS)}")
    kind = FAULTS[fault.kind]
    size = kind.size if fault.size is None else fault.size
    if not kind.low <= size <= kind.high:
        raise InputError(
            f"fault {fault.kind}", f"size {size} is out of range", f"{kind.low:g}..{kind.high:g} {kind.unit}"
        )
    if not (fault.start >= 0.0 and fault.duration > 0.0):
        raise InputError(f"fault {fault.kind}", "start or duration is negative", "give times in s from 0 on")
    return fault._replace(size=size)


class Injector:
    """Which faults act at a time, and what they make of a frame. The same seed gives the same faults."""

    def __init__(self, faults: list[Fault], seed: int) -> None:
        self.faults = [checked(fault) for fault in faults]
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1,)))
        self._held: dict[str, Frame | None] = {"drive": None, "host": None}
        self._good: dict[tuple[int, bool], Frame] = {}

    def size(self, kind: str, now: float) -> float | None:
        """Size of a kind that acts now, or None."""
        for fault in self.faults:
            if fault.kind == kind and fault.start <= now < fault.start + fault.duration:
                return fault.size
        return None

    def acts(self, kind: str, now: float) -> bool:
        """Whether a kind acts now."""
        return self.size(kind, now) is not None

    def edges(self) -> list[float]:
        """Times in s at which a fault begins or ends."""
        times = {edge for fault in self.faults for edge in (fault.start, fault.start + fault.duration)}
        return sorted(edge for edge in times if edge < NEVER)

    def through(self, to: str, frame: Frame, now: float) -> list[tuple[float, Frame]]:
        """What becomes of a frame that is complete now on its way ``to`` "drive" or "host": (time, frame)."""
        if self.acts(f"cut_to_{to}", now) or self._happens(f"loss_to_{to}", now):
            return []
        if to == "host" and self.acts("replay_to_host", now):
            frame = self._good.get(frame.key, frame)
        else:
            self._good[frame.key] = frame
        if frame.data and self._happens(f"corruption_to_{to}", now):
            bit = int(self._rng.integers(8 * len(frame.data)))
            data = bytearray(frame.data)
            data[bit // 8] ^= 1 << bit % 8
            frame = frame._replace(data=bytes(data))
        if frame.data and self._happens(f"truncation_to_{to}", now):
            frame = frame._replace(data=frame.data[:-1])
        late = self.size(f"delay_to_{to}", now) or 0.0
        jitter = self.size(f"jitter_to_{to}", now)
        if jitter is not None:
            late += jitter * self._rng.random()
        frames = [frame, frame] if self._happens(f"duplication_to_{to}", now) else [frame]
        held, self._held[to] = self._held[to], None
        if held is not None:
            frames.append(held)
        elif self._happens(f"reordering_to_{to}", now):
            self._held[to] = frames.pop(0)
        return [(now + late, each) for each in frames]

    def noise(self) -> float:
        """A standard normal draw."""
        return float(self._rng.standard_normal())

    def _happens(self, kind: str, now: float) -> bool:
        share = self.size(kind, now)
        return share is not None and self._rng.random() < share
