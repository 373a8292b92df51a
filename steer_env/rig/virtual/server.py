"""The virtual motor in real time on a real bus: it is late by what the host's scheduler is late."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

from steer_env.rig.bus import Link
from steer_env.rig.virtual.motor import VirtualMotor

TICK = 1e-3  # s: the longest that is waited for a frame
BEHIND = 0.1  # s: more than this is not caught up with, as after a suspend


class Served(NamedTuple):
    """What a virtual motor did: seconds, frames in and out, its state, angle in rad and torque in N m at the end."""

    seconds: float
    received: int
    sent: int
    state: str
    faults: tuple[str, ...]
    angle: float
    torque: float


def serve(
    motor: VirtualMotor, bus: Link, seconds: float = float("inf"), report: Callable[[Served], None] | None = None
) -> Served:
    """Let the motor live on a bus until ``seconds`` have passed; ``report`` is called about once per second."""
    started = time.monotonic()
    origin, received, sent, next_report = started - motor.now, 0, 0, started + 1.0
    while True:
        now = time.monotonic()
        if now - origin - motor.now > BEHIND:
            origin = now - motor.now
        for out in motor.advance_to(now - origin):
            sent += bus.send(out.frame)
        done = Served(
            now - started, received, sent, motor.drive.state, tuple(sorted(motor.drive.faults)),
            round(motor.wheel.state.pinion_angle, 9), round(motor.motor_torque, 9),
        )  # fmt: skip
        if now - started >= seconds:
            return done
        if report is not None and now >= next_report:
            next_report += 1.0
            report(done)
        wait = min(motor.next_event() - motor.now, TICK, started + seconds - now)
        got = bus.receive(max(wait, 0.0))
        while got is not None:
            received += 1
            # Never into the past of the motor: what waited in the socket counts as just come.
            for out in motor.advance_to(max(got.host_time - origin, motor.now)):
                sent += bus.send(out.frame)
            motor.submit(got.frame)
            got = bus.receive(0.0)
