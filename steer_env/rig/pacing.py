"""An elastic real-time step: absolute deadlines that are skipped when missed, never caught up with.

    pacer = Pacer(1e-3, link.now)
    while True:
        while (left := pacer.remaining()) > 0.0:
            take(link.receive(left))
        tick = pacer.tick()

Nothing here sleeps: whoever waits does something useful meanwhile, such as receiving. The clock is handed in, so that a
virtual clock runs the same code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

EARLY = 1e-9  # s: as near to a deadline as a float of seconds needs to come


class Tick(NamedTuple):
    """How a deadline was met: s late, and whole periods that were skipped because of it."""

    late: float
    skipped: int


class Pacer:
    """Deadlines at ``start + k period`` on a clock in s; ``overruns`` counts those that were skipped."""

    def __init__(self, period: float, now: Callable[[], float]) -> None:
        self.period, self._now = period, now
        self.restart()

    def restart(self) -> None:
        """Begin anew: the next deadline is one period from now."""
        self._start, self._count = self._now(), 1
        self.overruns = 0
        self.worst = 0.0

    @property
    def deadline(self) -> float:
        """When the next cycle begins, in s."""
        return self._start + self._count * self.period

    def remaining(self) -> float:
        """How many s are left until the next cycle begins; 0.0 when it is due."""
        left = self.deadline - self._now()
        return left if left > EARLY else 0.0

    def tick(self) -> Tick:
        """Begin a cycle: the deadlines that have gone by meanwhile are given up, the grid stays."""
        late = max(self._now() - self.deadline, 0.0)
        skipped = int((late + EARLY) / self.period)
        self._count += 1 + skipped
        self.overruns += skipped
        self.worst = max(self.worst, late)
        return Tick(late, skipped)
