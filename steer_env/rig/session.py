"""One drive under control: a cycle of limiting, sending, receiving and waiting, and the ways in and out.

    with RigSession(link, motor, plant, limits) as rig:
        rig.bring_up(timeout=5.0)
        rig.arm()
        reading = rig.cycle(torque)     # once per period; torque in N m as wished, not as granted

Every torque goes through the safety layer; nothing else in the program may send one. Anything that goes wrong ends in
``stop``: zero torque, the drive told to drop its current, again in each cycle that still follows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import TracebackType
from typing import Any

from steer_env.errors import RigError
from steer_env.plants import Plant
from steer_env.rig import account
from steer_env.rig.account import NO_STATUS
from steer_env.rig.arrival import Arrival
from steer_env.rig.bus import Link
from steer_env.rig.drive_limit import DriveLimit
from steer_env.rig.frame import Frame, Received
from steer_env.rig.gauge import Gauge, Reading
from steer_env.rig.motors.motor import DriveStatus, Motor, Rejected, Sample
from steer_env.rig.pacing import Pacer
from steer_env.rig.safety import HEALTHY_CYCLES, SafetyLayer, State
from steer_env.rig.safety_faults import LeakyScore
from steer_env.rig.safety_limits import Limits, Measurement
from steer_env.rig.watchdog import Watchdog

PERIOD = 1e-3  # s, the control period of every environment
POLL = 0.01  # s: a status older than this is asked for again
STATUS_AGE = 0.35  # s: a drive that has not told its state for longer is not on (ODrive's heartbeat: 0.1 s)
DOWN_TIMEOUT = 1.0  # s
REPEAT = 3  # times that a stop is sent at once

Tap = Callable[[Frame, float, bool], None]
"""Told every frame: (frame, host time in s, whether we sent it). For recorders."""


class RigSession:
    """A motor on a link, its safety layer, its pace, and (where there is one) its watchdog process.

    ``plant`` is what the control side believes of the wheel; it serves to estimate what a protocol does not tell.
    ``applied`` is the last torque sent in N m, ``arrived`` when the latest measurement came. ``patience``: factor on
    the period by which a cycle counts as late.
    """

    def __init__(
        self,
        link: Link,
        motor: Motor,
        plant: Plant,
        limits: Limits | None = None,
        watchdog: Watchdog | None = None,
        tap: Tap | None = None,
        patience: float = 1.0,
    ) -> None:
        self.link, self.motor, self.watchdog, self._tap = link, motor, watchdog, tap
        self.safety = SafetyLayer(motor.rated_torque, limits, patience * PERIOD, motor.counter_modulus)
        self.drive_limit = DriveLimit(motor, self.safety.limits.torque_cap)
        self.pacer = Pacer(PERIOD, link.now)
        self.status, self.reading = NO_STATUS, None  # type: tuple[DriveStatus, Reading | None]
        self.applied = 0.0
        self.late, self.skipped, self.round_trip = 0.0, 0, math.nan
        self.rejected, self.foreign = 0, 0
        self.gauge = Gauge(plant, PERIOD)
        self._arrival, self.arrived = Arrival(), math.nan
        self._refused = LeakyScore()
        self._intact = True
        self._new_status = False
        self._status_time = self._polled = -math.inf
        self._sent_at, self._fresh = 0.0, False

    def cycle(self, requested: Any) -> Reading | None:
        """One period: judge and send a torque in N m, receive until the next is due. The latest reading, if any."""
        now = self.link.now()
        self._look_around()
        was_armed = self.safety.state is State.ARMED
        torque = self.safety.filter(requested, self._measurement(now), now)
        self._intact = True
        if self.safety.state is State.TRIPPED and was_armed:
            self.stop(self.safety.trip_reason)
        elif self.safety.state is State.TRIPPED:
            self._send(self.motor.stop_frames())
        else:
            self._send((*self._polls(now), *self.motor.torque_frames(torque)))
        self.applied, self._sent_at, self._fresh = torque, now, False
        if self.watchdog is not None:
            self.watchdog.beat()
        while (left := self.pacer.remaining()) > 0.0:
            received = self.link.receive(left)
            if received is not None:
                self._take(received)
        while (received := self.link.receive(0.0)) is not None:  # what came while we were not looking
            self._take(received)
        self.late, self.skipped = self.pacer.tick()
        return self.reading

    def bring_up(self, timeout: float) -> None:
        """Walk the drive to "on" with zero torque, one transition per status; RigError after ``timeout`` s.

        Its own torque limit becomes the cap, and is read back where the drive can tell it.
        """
        self.pacer.restart()
        self.safety.disarm()
        self.drive_limit.restart()
        until = self.link.now() + timeout
        self._new_status = False
        while not (self.status.state == "on" and self.reading and self._new_status and self.drive_limit.settled):
            self._send(self.drive_limit.frames(self.link.now()))
            self.cycle(0.0)
            if self._new_status and self.status.state != "on":
                self._new_status = False
                self._send(self.motor.bring_up(self.status))
            if self.link.now() > until:
                self.stop("the drive does not come up")
                raise RigError(f"the drive does not come up in {timeout:g} s: {self.describe()}{account.silence(self)}")

    def arm(self, timeout: float = 1.0) -> None:
        """Do the second act after ``bring_up``: RigError where cycles are not healthy for long enough.

        Or where the drive has told that it would give more than the cap.
        """
        if refused := self.drive_limit.refusal():
            self.stop(refused)
            raise RigError(f"the rig cannot be armed: {refused}")
        self.foreign = 0
        self.gauge.restart()
        self.safety.unlock(self.link.now())
        if self.watchdog is not None:
            self.watchdog.watch(True)
        until, refused = self.link.now() + timeout, "no cycle yet"
        while refused:
            for _ in range(HEALTHY_CYCLES):
                self.cycle(0.0)
            refused = self.safety.arm(self.link.now())
            if refused and self.link.now() > until:
                self.stop(refused)
                raise RigError(f"the rig cannot be armed: {refused}; {self.describe()}")

    def bring_down(self, timeout: float = DOWN_TIMEOUT) -> None:
        """Zero torque, then the drive's state down; what it does not answer to is told it all the same."""
        self.safety.disarm()
        until = self.link.now() + timeout
        self._new_status = False
        while self.link.now() < until and not (self._new_status and self.status.state in ("off", "error")):
            if self._new_status:
                self._new_status = False
                self._send(self.motor.bring_down(self.status))
            self.cycle(0.0)
        self._stop_frames()
        if self.watchdog is not None:
            self.watchdog.watch(False)

    def stop(self, reason: str) -> None:
        """At once: no torque, and the drive told to drop its current. May be called again and from anywhere."""
        self.safety.trip(reason)
        self.applied = 0.0
        self._stop_frames()

    def close(self) -> None:
        """Bring the drive down and let go of the bus."""
        try:
            self.bring_down()
        finally:
            self._stop_frames()
            if self.watchdog is not None:
                self.watchdog.close()
            self.link.close()

    def __enter__(self) -> RigSession:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None:
            self.stop(f"{kind.__name__ if kind else 'error'}: {error}")
        self.close()

    def describe(self) -> str:
        """State of drive, safety and bus in a line, for messages."""
        return account.in_a_line(self)

    def report(self) -> dict[str, Any]:
        """What only a rig has, for ``info``."""
        return account.for_info(self)

    def _stop_frames(self) -> None:
        for _ in range(REPEAT):
            self._send(self.motor.stop_frames())

    def _look_around(self) -> None:
        """Trip on what no measurement tells: the bus, the watchdog, somebody else's commands."""
        if self.link.health().state == "bus-off":
            self.safety.trip("our controller is off the bus")
        if self.watchdog is not None and self.safety.state is State.ARMED:
            if self.watchdog.fired:
                self.safety.trip("the watchdog has dropped the drive")
            elif not self.watchdog.alive:
                self.safety.trip("the watchdog process is gone")

    def _polls(self, now: float) -> tuple[Frame, ...]:
        """Ask for a status that is old; never by a frame that would command a torque."""
        if now - max(self._status_time, self._polled) < POLL:
            return ()
        self._polled = now
        commands = {frame.key for frame in self.motor.torque_frames(0.0)}
        return tuple(frame for frame in self.motor.poll_frames() if frame.key not in commands)

    def _send(self, frames: tuple[Frame, ...]) -> None:
        for frame in frames:
            try:
                taken = self.link.send(frame)
            except (
                Exception
            ) as error:  # a bus that fails must not keep the next frame, or the next stop, from being tried
                taken = False
                self.safety.trip(f"the bus fails: {type(error).__name__}: {error}")
            if self._refused.broken_after(not taken):
                self.safety.trip("the bus takes no frames")
            if taken:
                self._tell(frame, self.link.now(), True)

    def _tell(self, frame: Frame, time: float, sent: bool) -> None:
        """Let the recorder know; one that fails ends the run, but never a stop."""
        if self._tap is not None:
            try:
                self._tap(frame, time, sent)
            except Exception as error:
                self._tap = None
                self.safety.trip(f"the recorder fails: {type(error).__name__}: {error}")

    def _take(self, received: Received) -> None:
        frame = received.frame
        arrived = self._arrival.of(received)
        self._tell(frame, arrived, False)
        asks = not frame.data and frame.key in self.motor.asking_identifiers
        if asks or frame.key in self.motor.command_identifiers:
            self.foreign += 1
            return
        self.drive_limit.take(frame)
        for message in self.motor.decode(frame):
            if isinstance(message, Sample):
                self.reading, self.arrived = self.gauge.take(message, received, self.applied), arrived
                if not self._fresh:
                    self._fresh, self.round_trip = True, received.host_time - self._sent_at
            elif isinstance(message, DriveStatus):
                self.status, self._status_time, self._new_status = message, received.host_time, True
            elif isinstance(message, Rejected):
                self.rejected += 1
                self._intact = False

    def _measurement(self, now: float) -> Measurement | None:
        """What the safety layer judges."""
        reading = self.reading
        if reading is None:
            return None
        on = self.status.state == "on" and not self.status.faults and now - self._status_time < STATUS_AGE
        return Measurement(
            reading.host_time,
            reading.angle,
            reading.rate,
            reading.motor_torque,
            reading.torsion_bar_torque,
            reading.counter,
            self._intact,
            on,
            self.foreign > 0,
        )
