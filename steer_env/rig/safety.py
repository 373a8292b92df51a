"""The last thing before the bus: it knows no controller, and its answer is zero unless all is well.

Pure logic with the time handed in. A torque leaves ``SafetyLayer.filter`` only after two separate acts, ``unlock`` and
``arm``, with healthy cycles between them; it is then bounded in size, in its rate (growth slower than decrease), in its
growth over any 250 ms, faded towards the end stop and towards the speed limit, and bounded in the energy that it gives
the wheel. Any fault (``safety_faults.py``) trips: zero at once, the reason kept, until it is unlocked and armed anew.

The shape (cap, asymmetric rate, windowed change, leaky scores, default deny) is that of the steering safety of opendbc;
the numbers are our own, for a wheel in a hand and not for a car's assist.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum
from typing import Any

from steer_env.rig.safety_faults import FaultFinder, is_finite
from steer_env.rig.safety_limits import Limits, Measurement, checked_limits

WINDOW = 0.25  # s over which the growth of |torque| is bounded (opendbc: 250 ms)
HORIZON = 0.05  # s: at the present rate the stored energy must last this long
UNLOCKED_FOR = 10.0  # s within which the second act must follow the first
HEALTHY_CYCLES = 20  # between the two acts


class State(Enum):
    """Torque passes in ARMED alone."""

    LOCKED = "locked"
    UNLOCKED = "unlocked"
    ARMED = "armed"
    TRIPPED = "tripped"


class SafetyLayer:
    """Bounds one drive's torque. All in SI; ``period`` of the control cycle in s.

    ``limited_by`` names the limits that changed the last request, ``trip_reason`` what tripped it.
    """

    def __init__(
        self, rated_torque: float, limits: Limits | None = None, period: float = 1e-3, counter_modulus: int = 0
    ) -> None:
        self.limits = checked_limits(limits or Limits(), rated_torque)
        self._faults = FaultFinder(self.limits, period, counter_modulus)
        self.state = State.LOCKED
        self.trip_reason = ""
        self.limited_by: tuple[str, ...] = ()
        self.energy = self.limits.energy_store
        self._healthy = 0
        self._zero()

    def unlock(self, now: float) -> None:
        """Do the first act: forgets a trip and begins to look whether all is well. Not while armed."""
        if self.state is not State.ARMED and is_finite(now):
            self.state, self._unlocked_at, self._healthy = State.UNLOCKED, now, 0
            self._faults.forget()

    def arm(self, now: float) -> str:
        """Do the second act: from now on torque passes. "" if so, else why not."""
        if self.state is not State.UNLOCKED:
            return f"unlock first: the rig is {self.state.value}"
        if not is_finite(now) or not 0.0 < now - self._unlocked_at <= UNLOCKED_FOR:
            return f"arm within {UNLOCKED_FOR:g} s after unlocking"
        if self._healthy < HEALTHY_CYCLES:
            return self._blocked_by or "not enough healthy cycles yet"
        self.state, self.trip_reason = State.ARMED, ""
        self.energy = self.limits.energy_store
        self._remember(0.0, self._now)
        return ""

    def disarm(self) -> None:
        """Back to locked; a trip's reason stays."""
        self.state = State.LOCKED
        self._zero()

    def trip(self, reason: str) -> None:
        """Let no torque pass until the rig is unlocked and armed anew; the first reason is kept."""
        if self.state is not State.TRIPPED:
            self.state, self.trip_reason = State.TRIPPED, reason
        self._zero()

    def filter(self, requested: Any, measured: Any, now: Any) -> float:
        """Torque in N m that may go to the drive for a requested one, given the latest measurement.

        Call it once per control cycle, whatever the state: it also judges the health that arming asks for. It never
        raises; what is not a finite number trips.
        """
        self.limited_by = ()
        reason = self._faults.fault(requested, measured, now, self._torque)
        if self.state is State.ARMED:
            if not reason:
                return self._bounded(float(requested), measured, float(now))
            self.trip(reason)
        self._blocked_by, self._healthy = reason, 0 if reason else self._healthy + 1
        if not reason:
            self._measured, self._now = measured, float(now)
        return 0.0

    def _zero(self) -> None:
        self._torque = 0.0
        self._blocked_by = ""
        self._lows: deque[tuple[float, float]] = deque()
        self._highs: deque[tuple[float, float]] = deque()

    def _bounded(self, requested: float, measured: Measurement, now: float) -> float:
        dt = now - self._now
        self._account(measured, dt)
        wanted = requested
        for name, (low, high) in (
            ("cap", (-self.limits.torque_cap, self.limits.torque_cap)),
            ("angle", self._angle_band(measured.angle)),
            ("speed", self._speed_band(measured.rate)),
            ("energy", self._energy_band(measured.rate)),
            ("rate", self._rate_band(dt)),
            ("window", self._window_band(now)),
        ):
            torque = min(max(wanted, low), high)
            if torque != wanted:
                self.limited_by += (name,)
            wanted = torque
        self._torque, self._measured, self._now = wanted, measured, now
        self._remember(wanted, now)
        return wanted

    def _account(self, measured: Measurement, dt: float) -> None:
        """Book the work that the last torque did on the wheel, and the income."""
        work = self._torque * (measured.angle - self._measured.angle)
        self.energy = min(self.energy - work + self.limits.energy_income * dt, self.limits.energy_store)

    def _angle_band(self, angle: float) -> tuple[float, float]:
        """Outward torque fades to zero on the way to the angle limit."""
        room = self.limits.angle_limit - abs(angle)
        return _one_sided(self.limits.torque_cap * room / self.limits.angle_softening, angle)

    def _speed_band(self, rate: float) -> tuple[float, float]:
        """Torque along the motion fades to zero on the way to the speed limit."""
        room = self.limits.speed_limit - abs(rate)
        return _one_sided(self.limits.torque_cap * room / self.limits.speed_softening, rate)

    def _energy_band(self, rate: float) -> tuple[float, float]:
        """Torque along the motion may not spend the stored energy within HORIZON."""
        way, left = abs(rate) * HORIZON, max(self.energy, 0.0)
        most = self.limits.torque_cap if left >= self.limits.torque_cap * way else left / way
        return _one_sided(most, rate)

    def _rate_band(self, dt: float) -> tuple[float, float]:
        up, down, last = self.limits.rate_up * dt, self.limits.rate_down * dt, self._torque
        high = last + up if last >= 0.0 else min(last + down, up)
        low = last - up if last <= 0.0 else max(last - down, -up)
        return low, high

    def _window_band(self, now: float) -> tuple[float, float]:
        """From the least and the greatest torque of the last 250 ms; towards zero is always free."""
        for ends in (self._lows, self._highs):
            while ends[0][0] < now - WINDOW:  # the last cycle is younger: it ends the loop
                ends.popleft()
        least, most = self._lows[0][1], self._highs[0][1]
        return min(most, 0.0) - self.limits.window_change, max(least, 0.0) + self.limits.window_change

    def _remember(self, torque: float, now: float) -> None:
        """Keep ``_lows`` rising and ``_highs`` falling, so that their first entries are the extremes."""
        while self._lows and self._lows[-1][1] >= torque:
            self._lows.pop()
        while self._highs and self._highs[-1][1] <= torque:
            self._highs.pop()
        self._lows.append((now, torque))
        self._highs.append((now, torque))


def _one_sided(most: float, direction: float) -> tuple[float, float]:
    """The band that ends at ``most`` N m in a direction and is open against it."""
    return (-math.inf, most) if direction >= 0.0 else (-most, math.inf)
