"""What is wrong with a request, a measurement or the clock: the reasons for which a rig trips."""

from __future__ import annotations

import math
from numbers import Real
from typing import Any

from steer_env.rig.safety_limits import Limits, Measurement

SCORE_LIMIT = 5  # a leaky score at which a counter, a checksum or the pace counts as broken (opendbc)
LATE = 1.5  # periods after which a cycle counts as missed
FORGET = 0.2  # s in which the mismatch of angle and rate is forgotten
TORQUE_MEAN = 0.03  # s over which the motor's torque is compared with the command: many times its lag and delay


def is_finite(value: Any) -> bool:
    """Whether a value is one real, finite number; never raises."""
    try:
        return isinstance(value, Real) and math.isfinite(value)
    except OverflowError:  # an integer beyond every float
        return False


class LeakyScore:
    """Counts misses up and successes down, between 0 and SCORE_LIMIT, where it counts as broken."""

    def __init__(self) -> None:
        self.score = 0

    def broken_after(self, missed: bool) -> bool:
        """Take one more outcome; True while the score is at its limit."""
        self.score = min(max(self.score + (1 if missed else -1), 0), SCORE_LIMIT)
        return self.score == SCORE_LIMIT


class FaultFinder:
    """Judges every cycle. ``counter_modulus`` 0: the protocol has no counter. ``period`` in s."""

    def __init__(self, limits: Limits, period: float, counter_modulus: int) -> None:
        self.limits, self.period, self.counter_modulus = limits, period, counter_modulus
        self.forget()

    def forget(self) -> None:
        """Forget the past: what comes next is the first cycle."""
        self._now: float | None = None
        self._last: Measurement | None = None
        self._pace, self._frames = LeakyScore(), LeakyScore()
        self._mismatch = self._excess = 0.0
        self._override_since = math.inf
        self._moved_at = -math.inf

    def fault(self, requested: Any, measured: Any, now: Any, applied: float) -> str:
        """Why this cycle may carry no torque, or "".

        ``applied`` is the torque in N m that the drive was last told. A request or a measurement with anything but
        finite numbers is a fault, and is not remembered.
        """
        if not is_finite(now):
            return "the clock gave no number"
        if not is_finite(requested):
            return "the requested torque is not a finite number"
        if not isinstance(measured, Measurement) or not all(map(is_finite, measured)):
            return "the measurement is not made of finite numbers"
        reason = (
            self._clock_fault(now) or self._frame_fault(measured, now) or self._motion_fault(measured, now, applied)
        )
        self._last = measured
        return reason

    def _clock_fault(self, now: float) -> str:
        before, self._now = self._now, now
        if before is None:
            return ""
        gap = now - before
        missed = self._pace.broken_after(gap > LATE * self.period)
        if gap <= 0.0:
            return "the clock does not advance"
        if gap > self.limits.longest_cycle:
            return "a control cycle came much too late"
        return "too many control cycles came late" if missed else ""

    def _frame_fault(self, measured: Measurement, now: float) -> str:
        last = self._last
        if measured.foreign:
            return "somebody else sends our commands"
        if not measured.drive_on:
            return "the drive reports an error or is not on"
        if measured.time > now:
            return "the measurement is from the future"
        if now - measured.time > self.limits.stale_after:
            return "the measurement is stale"
        if last is None:
            return ""
        if measured.time < last.time:
            return "the measurements are out of order"
        if measured.time == last.time:
            return ""  # the same measurement once more: only its age counts
        skipped = self.counter_modulus > 0 and measured.counter != (last.counter + 1) % self.counter_modulus
        return "counter or checksum broken" if self._frames.broken_after(skipped or not measured.intact) else ""

    def _motion_fault(self, measured: Measurement, now: float, applied: float) -> str:
        limits = self.limits
        if abs(measured.angle) > limits.angle_limit:
            return "the wheel is beyond the angle limit"
        if abs(measured.rate) > limits.speed_limit:
            return "the wheel is beyond the speed limit"
        if abs(measured.driver_torque) <= limits.override_torque:
            self._override_since = math.inf
        else:
            self._override_since = min(self._override_since, now)
            if now - self._override_since >= limits.override_time:
                return "the driver overrides"
        last = self._last
        if last is None:
            return ""
        dt, turned = measured.time - last.time, measured.angle - last.angle
        if abs(turned) > limits.speed_limit * dt + limits.jump:
            return "the angle jumped"
        self._mismatch = self._mismatch * math.exp(-dt / FORGET) + turned - measured.rate * dt
        if not abs(self._mismatch) <= limits.motion_mismatch:  # so that NaN is a fault
            return "angle and rate contradict each other"
        share = math.exp(-dt / TORQUE_MEAN)
        self._excess = share * self._excess + (1.0 - share) * (measured.motor_torque - applied)
        if not abs(self._excess) <= limits.torque_mismatch:
            return "the motor does not give the torque that it is told"
        if _reading(measured) != _reading(last) or abs(applied) < limits.frozen_torque:
            self._moved_at = now
        return "the sensor is stuck" if now - self._moved_at > limits.frozen_after else ""


def _reading(measured: Measurement) -> tuple[float, float, float]:
    return measured.angle, measured.rate, measured.motor_torque
