"""Turning the wheel to straight ahead before an episode: slowly, weakly, and not for ever."""

from __future__ import annotations

from steer_env.errors import RigError
from steer_env.rig.session import PERIOD, RigSession

ANGLE, RATE, FOR = 0.02, 0.05, 0.1  # rad, rad/s, s: settled
PACE = 0.8  # rad/s at which the target moves to zero
STIFFNESS, INTEGRAL, DAMPING = 4.0, 6.0, 0.25  # N m/rad, N m/(rad s), N m s/rad: for a bare steer-by-wire wheel
STRONGEST = 1.0  # N m


def settle(session: RigSession, timeout: float) -> None:
    """Wait until the wheel stands straight ahead, turning it there; RigError after ``timeout`` s or at a trip.

    A wheel that already stands there gets no torque. At the end the torque has gone back to zero and the wheel stays.
    """
    until, quiet, pull, torque = session.link.now() + timeout, 0, 0.0, 0.0
    target: float | None = None
    while quiet < round(FOR / PERIOD):
        reading = session.cycle(torque)
        if session.safety.trip_reason:
            raise RigError(f"the rig tripped while the wheel was turned straight: {session.safety.trip_reason}")
        if session.link.now() > until:
            raise RigError(f"the wheel did not settle straight ahead in {timeout:g} s: is it held, or its zero wrong?")
        if reading is None:
            continue
        near = abs(reading.angle) < ANGLE
        if near and abs(reading.rate) < RATE:
            target, pull, torque = None, 0.0, 0.0
            quiet += 1
            continue
        quiet = 0
        if near and target is None:
            torque = -DAMPING * reading.rate  # it rolls through: only slow it down
            continue
        target = reading.angle if target is None else _towards_zero(target, PACE * PERIOD)
        error = target - reading.angle
        pull = min(max(pull + INTEGRAL * error * PERIOD, -STRONGEST), STRONGEST)
        torque = min(max(STIFFNESS * error + pull - DAMPING * reading.rate, -STRONGEST), STRONGEST)


def _towards_zero(value: float, step: float) -> float:
    return max(value - step, 0.0) if value > 0.0 else min(value + step, 0.0)
