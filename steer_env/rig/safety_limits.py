"""What a torque on its way to the drive may be at most, and what is known when it is judged."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.errors import InputError
from steer_env.units import Quantity, check_ranges

_OURS = "assumption"


class Limits(NamedTuple):
    """Limits of a haptic rig: 2 N m cannot hurt a hand that holds a wheel rim; more is asked for explicitly.

    ``rate_up`` bounds the growth of |torque|, ``rate_down`` its decrease; ``window_change`` bounds how far |torque| may
    grow within any 250 ms, however often commands are sent.
    """

    torque_cap: Annotated[float, Quantity("N m", "largest torque", 1e-3, 50.0, _OURS)] = 2.0
    rate_up: Annotated[float, Quantity("N m/s", "fastest growth of |torque|", 0.1, 1e5, _OURS)] = 100.0
    rate_down: Annotated[float, Quantity("N m/s", "fastest decrease of |torque|", 0.1, 1e5, _OURS)] = 400.0
    window_change: Annotated[float, Quantity("N m", "largest growth of |torque| in 250 ms", 1e-3, 50.0, _OURS)] = 1.5
    angle_limit: Annotated[float, Quantity("rad", "angle beyond which the rig trips", 0.1, 30.0, _OURS)] = 8.0
    angle_softening: Annotated[float, Quantity("rad", "outward torque fades over this", 0.01, 10.0, _OURS)] = 0.5
    speed_limit: Annotated[float, Quantity("rad/s", "speed beyond which the rig trips", 0.1, 100.0, _OURS)] = 20.0
    speed_softening: Annotated[float, Quantity("rad/s", "driving torque fades over this", 0.1, 50.0, _OURS)] = 5.0
    energy_store: Annotated[float, Quantity("J", "most that the motor gives without income", 0.01, 500.0, _OURS)] = 6.0
    energy_income: Annotated[float, Quantity("W", "mean power it may give for ever", 0.0, 50.0, _OURS)] = 2.0
    override_torque: Annotated[float, Quantity("N m", "driver's torque that means: stop", 0.1, 60.0, _OURS)] = 12.0
    override_time: Annotated[float, Quantity("s", "for how long it must last", 0.0, 5.0, _OURS)] = 0.1
    stale_after: Annotated[float, Quantity("s", "oldest measurement to act on", 1e-4, 0.1, _OURS)] = 5e-3
    longest_cycle: Annotated[float, Quantity("s", "longest gap between two commands", 1e-4, 0.1, _OURS)] = 10e-3
    jump: Annotated[float, Quantity("rad", "angle step beyond what the speed limit allows", 1e-4, 1.0, _OURS)] = 0.02
    motion_mismatch: Annotated[
        float, Quantity("rad", "angle turned minus integrated rate, forgotten in 0.2 s", 1e-3, 5.0, _OURS)
    ] = 0.15
    torque_mismatch: Annotated[
        float, Quantity("N m", "motor's torque minus the command, mean over 30 ms", 1e-3, 50.0, _OURS)
    ] = 0.5
    frozen_after: Annotated[float, Quantity("s", "same readings so long under torque: stuck", 0.01, 9.0, _OURS)] = 0.5
    frozen_torque: Annotated[float, Quantity("N m", "torque under which that counts", 0.0, 50.0, _OURS)] = 0.3


class Measurement(NamedTuple):
    """One measurement as the rig decoded it, SI, signs after calibration.

    ``time`` is when it was received, in s on the clock that ``now`` is taken from. ``driver_torque`` is measured or
    estimated; ``counter`` is the frame's counter or -1 where the protocol has none; ``intact`` is False where a
    checksum did not fit; ``drive_on`` is True while the drive reports no error and obeys torque commands; ``foreign``
    is True once somebody else has sent a frame that only the rig may send.
    """

    time: float
    angle: float
    rate: float
    motor_torque: float
    driver_torque: float
    counter: int = -1
    intact: bool = True
    drive_on: bool = True
    foreign: bool = False


def limits_for(torque_cap: float, rated_torque: float, limits: Limits | None = None) -> Limits:
    """Limits for a raised (or lowered) cap: rates, window, energy and the torque's tolerance grow with it.

    Args:
        torque_cap: largest torque in N m; not above the drive's rating.
        rated_torque: what the drive is rated for, N m.
        limits: what to start from; the default limits where None.

    Raises:
        InputError: the cap is not a number above zero, or above the drive's rating.
    """
    base = limits or Limits()
    scale = torque_cap / base.torque_cap
    grown = base._replace(
        torque_cap=torque_cap,
        rate_up=base.rate_up * scale,
        rate_down=base.rate_down * scale,
        window_change=base.window_change * scale,
        energy_store=base.energy_store * scale,
        energy_income=base.energy_income * scale,
        torque_mismatch=base.torque_mismatch * scale,
    )
    return checked_limits(grown, rated_torque)


def checked_limits(limits: Limits, rated_torque: float) -> Limits:
    """The limits, if they are in range and the cap is within the drive's rating (N m); else InputError."""
    check_ranges(limits, "limits")
    if not limits.torque_cap <= rated_torque:
        raise InputError(
            "limits",
            f"torque_cap = {limits.torque_cap:g} N m is above the drive's rating of {rated_torque:g} N m",
            "lower the cap",
        )
    if not limits.rate_up <= limits.rate_down:
        raise InputError(
            "limits",
            f"rate_up = {limits.rate_up:g} N m/s is above rate_down = {limits.rate_down:g} N m/s",
            "a torque must be able to fall at least as fast as it grows",
        )
    if not limits.angle_softening <= limits.angle_limit or not limits.speed_softening <= limits.speed_limit:
        raise InputError("limits", "a softening zone is wider than its limit", "make it narrower")
    return limits
