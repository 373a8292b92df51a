"""What ``steer-env rig check`` looks at, one function per check; each says what it found and whether that is right."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from steer_env.errors import RigError
from steer_env.plants import PLANTS
from steer_env.rig.bus import Link
from steer_env.rig.motors.motor import DriveStatus, Motor, Sample
from steer_env.rig.safety import State
from steer_env.rig.safety_limits import limits_for
from steer_env.rig.session import RigSession
from steer_env.rig.watchdog import STALL, Watchdog

CAP = 0.5  # N m that a check uses at most: moves a free wheel, holds none against a hand
TURN = 0.05  # rad by which the wheel must turn to show its sign
STILL = 0.5  # s
SILENCES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # s: rungs between which the drive's own watchdog lies
STALLED = 0.5  # s for which the program plays dead


class Finding(NamedTuple):
    """One line of the result; ``passed`` None: for a person to judge."""

    check: str
    passed: bool | None
    found: str


@dataclass
class Bench:
    """The rig under check: an open link, its motor, how a watchdog is started, and what the checks measured."""

    link: Link
    motor: Motor
    make_watchdog: Callable[[], Watchdog | None]
    round_trips: list[float] = field(default_factory=list)
    late: list[float] = field(default_factory=list)

    @contextmanager
    def session(self, watchdog: Watchdog | None = None, **limits: Any) -> Iterator[RigSession]:
        """An armed session whose drive is down again afterwards; the link stays open."""
        base = limits_for(min(CAP, self.motor.rated_torque), self.motor.rated_torque)._replace(**limits)
        session = RigSession(self.link, self.motor, PLANTS["SbW"], base, watchdog)
        try:
            session.bring_up(5.0)
            session.arm()
            yield session
        except BaseException as error:
            session.stop(str(error))
            raise
        finally:
            session.bring_down()


def bus_is_up(bench: Bench) -> Finding:
    """Listen for half a second."""
    frames = _idle(bench.link, STILL)
    health = bench.link.health()
    found = f"{health.state}, {frames} frames and {health.error_frames} error frames in {STILL:g} s"
    return Finding("bus up", health.state == "active" and health.error_frames == 0, found)


def motor_answers(bench: Bench) -> Finding:
    """Ask for status and sample, without a torque."""
    status: DriveStatus | None = None
    sample: Sample | None = None
    until = bench.link.now() + 2.0
    while bench.link.now() < until and not (status and sample):
        for frame in bench.motor.poll_frames():
            bench.link.send(frame)
        received = bench.link.receive(0.02)
        for message in bench.motor.decode(received.frame) if received else ():
            status = message if isinstance(message, DriveStatus) else status
            sample = message if isinstance(message, Sample) else sample
    if status is None or sample is None:
        missing = "no status" if status is None else "no sample"
        return Finding("motor answers", False, f"{missing} in 2 s: supply, node, bit rate, termination?")
    faults = f", faults {', '.join(status.faults)}" if status.faults else ""
    return Finding("motor answers", True, f"drive {status.state}{faults}; wheel at {sample.angle:.3f} rad")


def zero(bench: Bench) -> Finding:
    """Where the wheel stands now; a person judges whether that is straight ahead."""
    with bench.session() as session:
        angle = session.reading.angle if session.reading else math.nan
    return Finding("zero", None, f"{angle:+.4f} rad now; if the wheel is straight, correct the option zero by that")


def own_limit(bench: Bench) -> Finding:
    """The drive's own torque limit, which the session has set to the cap of these checks."""
    with bench.session() as session:
        torque, how = session.drive_limit.torque, session.motor.own_limit
    if how == "none" or (how == "told" and math.isnan(torque)):
        return Finding(
            "drive's own limit", None, "not known here: set it with the drive's tools to what you mean to use"
        )
    if how == "set":
        return Finding("drive's own limit", None, f"{CAP:g} N m was sent; the drive cannot confirm it")
    return Finding("drive's own limit", True, f"{torque:.3f} N m read back, cap {CAP:g} N m")


def timing(bench: Bench, seconds: float) -> Finding:
    """Cycles of zero torque: how long an answer takes, and how late cycles begin."""
    with bench.session() as session:
        for _ in range(round(seconds / session.pacer.period)):
            session.cycle(0.0)
            bench.round_trips.append(session.round_trip)
            bench.late.append(session.late)
        overruns, state, reason = session.pacer.overruns, session.safety.state, session.safety.trip_reason
    p50, p99 = np.percentile(bench.round_trips, [50, 99]) * 1e3
    late = np.percentile(bench.late, 99) * 1e3
    found = f"round trip p50 {p50:.2f}, p99 {p99:.2f} ms; cycles late p99 {late:.2f} ms, {overruns} left out"
    if state is not State.ARMED:
        return Finding("timing", False, f"{found}; tripped: {reason}")
    return Finding("timing", bool(p99 < 5.0), found)


def limits_limit(bench: Bench) -> Finding:
    """Ask for far too much, forwards and backwards: cap and rate must hold, and so must the drive."""
    worst_step, worst, given = 0.0, 0.0, 0.0
    with bench.session() as session:
        limits, last = session.safety.limits, 0.0
        for k in range(60):
            session.cycle(1e3 if k // 15 % 2 else -1e3)
            worst_step = max(worst_step, abs(session.applied) - abs(last))
            worst, last = max(worst, abs(session.applied)), session.applied
            given = max(given, abs(session.reading.motor_torque) if session.reading else math.inf)
    most_step = limits.rate_up * limits.longest_cycle
    obeys = given <= 1.2 * worst + 0.1 * CAP
    passed = 0.0 < worst <= limits.torque_cap and worst_step <= most_step and obeys
    return Finding("limits limit", passed, f"asked 1000 N m: {worst:.3f} sent, {given:.3f} given, cap {CAP:g} N m")


def bad_request_trips(bench: Bench) -> Finding:
    """A torque that is no number must end in a drive that is off."""
    with bench.session() as session:
        session.cycle(math.nan)
        reason = session.safety.trip_reason
        for _ in range(50):
            session.cycle(0.1)
        applied, drive = session.applied, session.status.state
    return Finding("bad request trips", bool(reason) and applied == 0.0, f"{reason or 'no trip'}; drive {drive}")


def sign(bench: Bench) -> Finding:
    """A growing torque to the left until the wheel turns: its angle must grow; whether that was left, a person sees."""
    turned = 0.0
    with bench.session() as session:
        start = session.reading.angle if session.reading else math.nan
        for k in range(1500):
            session.cycle(min(CAP, 0.3e-3 * k))
            turned = (session.reading.angle if session.reading else math.nan) - start
            if not abs(turned) < TURN or session.safety.state is not State.ARMED:
                break
        reason = session.safety.trip_reason
    if abs(turned) < TURN:
        return Finding("sign", False, f"the wheel turned {turned:+.4f} rad only: is it held? {reason}")
    look = "was that to the left? If not, give the option sign the other value"
    found = f"a positive torque turned it {turned:+.3f} rad"
    return Finding(
        "sign", turned > 0.0, f"{found}; {look if turned > 0.0 else 'torque and angle contradict each other'}"
    )


def drive_watchdog(bench: Bench) -> Finding:
    """Without our own watchdog: after how long a silence does the drive give up? For a person to judge."""
    longest = 0.0
    for silence in SILENCES:
        with bench.session() as session:
            session.cycle(0.1)
            _idle(session.link, silence)
            state = _state_after_silence(session)
        if state != "on":
            return Finding("drive's own watchdog", None, f"between {1e3 * longest:g} and {1e3 * silence:g} ms: {state}")
        longest = silence
    return Finding("drive's own watchdog", None, f"none within {1e3 * longest:g} ms: set one if the drive can")


def our_watchdog(bench: Bench) -> Finding:
    """Play dead with a torque on: the second process must have dropped the drive."""
    watchdog = bench.make_watchdog()
    if watchdog is None:
        return Finding("watchdog process", None, "no second process can open this bus: the drive's own is all there is")
    watchdog.start()
    priority = watchdog.priority
    try:
        with bench.session(watchdog) as session:
            for _ in range(50):
                session.cycle(0.1)
            _idle(session.link, STALLED)
            fired, state = watchdog.fired, _state_after_silence(session)
            session.cycle(0.1)
            passed = fired and state != "on" and session.safety.state is State.TRIPPED
    finally:
        watchdog.close()
    found = f"fired {'after' if fired else 'NOT after'} {1e3 * STALL:g} ms without a beat; drive {state}; "
    found += f"runs {priority}" + ("" if priority == "real time" else ": a crowded computer can hold it up")
    return Finding("watchdog process", passed, found)


def _idle(link: Link, seconds: float) -> int:
    """Send nothing for a while, on the link's own clock; how many frames came."""
    frames, until = 0, link.now() + seconds
    while (left := until - link.now()) > 1e-9:
        frames += link.receive(left) is not None
    return frames


def _state_after_silence(session: RigSession) -> str:
    """What the drive says of itself when it is only asked."""
    until = session.link.now() + 1.0
    while session.link.now() < until:
        for frame in session.motor.poll_frames():
            session.link.send(frame)
        received = session.link.receive(0.05)
        for message in session.motor.decode(received.frame) if received else ():
            if isinstance(message, DriveStatus):
                return message.state
    return "silent"


WITHOUT_TORQUE = (bus_is_up, motor_answers)
WITH_TORQUE = (zero, own_limit, limits_limit, bad_request_trips, sign, drive_watchdog, our_watchdog)


def all_checks(bench: Bench, armed: bool, seconds: float) -> Iterator[Finding]:
    """Every check in order; those with a torque only if ``armed``. After a failure to answer the rest is left out."""
    for check in WITHOUT_TORQUE:
        finding = check(bench)
        yield finding
        if not finding.passed:
            return
    if not armed:
        yield Finding("torque", None, "left out: give --arm")
        return
    for check in (partial(timing, seconds=seconds), *WITH_TORQUE):
        try:
            yield check(bench)
        except RigError as error:
            name = getattr(check, "__name__", "timing").replace("_", " ")
            yield Finding(name, False, str(error))
