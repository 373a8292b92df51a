"""The virtual motor on a virtual clock: frames in, frames out, the same bits every time.

>>> motor = VirtualMotor("senso_wheel", seed=1)
>>> received = motor.exchange(frames, 1e-3)  # frames sent now; what reaches the host within 1 ms
>>> link = SteppedLink(motor)  # virtual/link.py, or with the manners of a bus: send, receive(timeout), now
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from steer_env.physics.motor import limited_command
from steer_env.plants.plant_set import Plant
from steer_env.plants.sbw import SBW
from steer_env.rig.bus import Health
from steer_env.rig.frame import Frame, Received
from steer_env.rig.motors import make
from steer_env.rig.virtual import drive_class
from steer_env.rig.virtual.bus_faults import BusFaults
from steer_env.rig.virtual.drive import Drive
from steer_env.rig.virtual.drive_faults import DriveFaults
from steer_env.rig.virtual.faults import Fault, Injector
from steer_env.rig.virtual.wheel import Imperfections, Readings, Wheel
from steer_env.rig.virtual.wire import Wire

HOST, DRIVE = "host", "drive"


class VirtualMotor:
    """Drive, plant and wire of one motor.

    Args:
        name: a row of MOTORS.
        seed: of sensor noise and faults; the same seed and the same frames give the same bits.
        faults: what goes wrong, and when (``virtual.faults.FAULTS``).
        plant: the steer-by-wire plant on the motor.
        imperfections: cogging and unbalance of the wheel.
        noise: whether the sensors are noisy.
        bitrate: bit/s of the wire, None: the motor's own; 0: frames take no time.
        watchdog_s: of the drive; None: its own default, 0: none.
        dead_time: s from a command's arrival to its acting.
        angle: rad at which wheel and rotor rest at the start.
        options: of the drive (``motors.make``), over its SETTINGS; sign and zero need not be the host's.
    """

    def __init__(
        self,
        name: str,
        seed: int = 0,
        faults: Sequence[Fault] = (),
        *,
        plant: Plant = SBW,
        imperfections: Imperfections | None = None,
        noise: bool = True,
        bitrate: int | None = None,
        watchdog_s: float | None = None,
        dead_time: float = 0.0,
        angle: float = 0.0,
        **options: Any,
    ) -> None:
        kind = drive_class(name)
        motor = make(name, **{**kind.SETTINGS, **options})
        self.drive: Drive = kind(motor, watchdog_s)
        self.injector = Injector(list(faults), seed)
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,))) if noise else None
        self.wheel = Wheel(plant, imperfections or Imperfections(), rng, angle)
        self.wire = Wire(motor.bitrate if bitrate is None else bitrate, motor.data_bitrate)
        self.now = 0.0
        self.dead_time = dead_time
        self.bus_off_count = 0
        self._bus = BusFaults(self.injector, motor)
        self._hurt = DriveFaults(self.injector, self.drive)
        self._time = 0.0  # of the wheel, which lags behind until somebody looks
        self._target, self._command_time = 0.0, 0.0
        self._pending: list[tuple[float, int, str, Any]] = []
        self._order = 0
        self._out: list[Received] = []
        self._edges = self.injector.edges()
        self._host_off = False

    def submit(self, frame: Frame) -> bool:
        """The host hands a frame to its controller now; False where that is bus-off or full."""
        if self.injector.acts("bus_off_host", self.now):
            return False
        self._bus.heard(frame, from_host=True)
        return self.wire.queue(HOST, frame, self.now)

    def advance(self, dt: float) -> list[Received]:
        """Let dt seconds pass; what reached the host meanwhile, in order."""
        return self.advance_to(self.now + dt)

    def advance_to(self, end: float) -> list[Received]:
        """Let time pass until ``end`` in s; what reached the host meanwhile, in order."""
        while True:
            at = self.next_event()
            if at > end:
                break
            self.now = max(at, self.now)
            self._happen(at)
        self.now = max(end, self.now)
        self._follow(self.now)
        out, self._out = self._out, []
        return out

    def exchange(self, frames: Sequence[Frame], dt: float) -> list[Received]:
        """Submit frames now, then let dt seconds pass."""
        for frame in frames:
            self.submit(frame)
        return self.advance(dt)

    def next_event(self) -> float:
        """When something happens next if no frame is submitted, in s."""
        pending = self._pending[0][0] if self._pending else math.inf
        edge = self._edges[0] if self._edges else math.inf
        return min(self.wire.due(), pending, self.drive.due(), edge, self._bus.due(self.now))

    def health(self) -> Health:
        """Of the host's controller: an error frame per frame it could not send is not modelled, bus-off is."""
        return Health(
            "bus-off" if self._host_off else "active", bus_off=self.bus_off_count, send_errors=self.wire.refused
        )

    @property
    def motor_torque(self) -> float:
        """Torque in N m that the motor gives now, positive to the left."""
        self._follow(self.now)
        return self.wheel.state.motor_torque

    def _happen(self, at: float) -> None:
        """Everything that is due at a time, one thing per call."""
        if self._edges and self._edges[0] <= at:
            self._edges.pop(0)
            self._edge()
        elif self._pending and self._pending[0][0] <= at:
            _, _, what, content = heapq.heappop(self._pending)
            if what == "torque":
                self._aim(content)
            elif what == HOST:
                self._out.append(Received(content, self.now, self.now))
            else:
                self._to_drive(content)
        elif self.wire.due() <= at:
            self._deliver()
        elif self.drive.due() <= at:
            self._send(self.drive.tick(self._readings(), self.now))
            self._retarget()
        else:
            for frame in self._bus.frames(self.now):
                self.wire.queue("other", frame, self.now)

    def _deliver(self) -> None:
        sent = self.wire.complete()
        if sent.node != DRIVE and not self.injector.acts("bus_off_drive", self.now):
            for at, frame in self.injector.through(DRIVE, sent.frame, sent.time):
                self._later(at, DRIVE, frame)
        if sent.node != HOST and not self._host_off:
            for at, frame in self.injector.through(HOST, sent.frame, sent.time):
                self._later(at, HOST, frame)

    def _to_drive(self, frame: Frame) -> None:
        if self.drive.powered:
            self._send(self.drive.receive(frame, self._readings(), self.now))
            self._retarget()

    def _send(self, frames: list[Frame]) -> None:
        if self.injector.acts("silent_drive", self.now) or self.injector.acts("bus_off_drive", self.now):
            return
        for frame in frames:
            self._bus.heard(frame, from_host=False)
            self.wire.queue(DRIVE, frame, self.now)

    def _readings(self) -> Readings:
        self._follow(self.now)
        return self._hurt.readings(self.wheel.read(), self.now)

    def _edge(self) -> None:
        self._follow(self.now)
        off = self.injector.acts("bus_off_host", self.now)
        if off and not self._host_off:
            self.bus_off_count += 1
            self.wire.drop(HOST)
        self._host_off = off
        if self.injector.acts("bus_off_drive", self.now):
            self.wire.drop(DRIVE)
        self._hurt.edge(self.now)
        self._retarget()

    def _retarget(self) -> None:
        """Let the drive's command act, after its dead time; switching off acts at once."""
        target = self._hurt.target(self.drive.target(), self.now)
        if self.drive.state == "on" and self.dead_time > 0.0:
            self._later(self.now + self.dead_time, "torque", target)
            return
        if self.drive.state != "on":
            self._pending = [entry for entry in self._pending if entry[2] != "torque"]
            heapq.heapify(self._pending)
        self._aim(target)

    def _aim(self, target: float) -> None:
        self._follow(self.now)
        if self.drive.state == "on":
            since = max(self.now - self._command_time, 1e-6)
            target = limited_command(target, self._target, self.wheel.plant.motor, since)
        self._target, self._command_time = target, self.now

    def _follow(self, time: float) -> None:
        """Bring the wheel up to a time."""
        if time > self._time:
            self.wheel.advance(self._target, time - self._time)
            self._time = time

    def _later(self, at: float, what: str, content: Any) -> None:
        self._order += 1
        heapq.heappush(self._pending, (at, self._order, what, content))
