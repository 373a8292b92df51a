"""Deadlines stay on their grid; what was missed is given up. Only a virtual clock: wall time is never asserted."""

import itertools

import pytest

from steer_env.rig.pacing import Pacer


class Time:
    def __init__(self):
        self.value = 100.0

    def __call__(self):
        return self.value


def run(pacer, time, work):
    """Cycles whose work takes the given s; when each began."""
    begun = []
    for seconds in work:
        time.value += pacer.remaining()
        pacer.tick()
        begun.append(time.value)
        time.value += seconds
    return begun


def test_deadlines_do_not_drift():
    """Catches sleeping for a period after the work: 10 000 cycles with work would then take too long."""
    time = Time()
    pacer = Pacer(1e-3, time)
    begun = run(pacer, time, [0.4e-3] * 10_000)
    assert begun[-1] == pytest.approx(100.0 + 10.0, abs=1e-8)
    assert (pacer.overruns, pacer.worst) == (0, pytest.approx(0.0, abs=1e-8))


def test_after_a_stall_there_is_no_burst():
    """A stall of 50 ms at 1 kHz gives up its deadlines: the next cycles are 1 ms apart again, on the old grid."""
    time = Time()
    pacer = Pacer(1e-3, time)
    begun = run(pacer, time, [0.1e-3, 50.3e-3, 0.1e-3, 0.1e-3, 0.1e-3])
    gaps = [later - earlier for earlier, later in itertools.pairwise(begun)]
    assert gaps == pytest.approx([1e-3, 50.3e-3, 0.7e-3, 1e-3], abs=1e-8)
    assert pacer.overruns == 49  # of the 50 that were due, one is the late cycle itself
    assert pacer.worst == pytest.approx(49.3e-3, abs=1e-8)


def test_a_little_late_is_no_overrun():
    time = Time()
    pacer = Pacer(1e-3, time)
    time.value += 1.9e-3
    assert pacer.remaining() == 0.0
    late, skipped = pacer.tick()
    assert late == pytest.approx(0.9e-3)
    assert skipped == 0
    assert pacer.remaining() == pytest.approx(0.1e-3)
    time.value += 2.05e-3
    assert pacer.tick().skipped == 1


def test_exactly_a_period_late_skips_exactly_one():
    time = Time()
    pacer = Pacer(1e-3, time)
    time.value += 2e-3
    assert pacer.tick().skipped == 1
    assert pacer.remaining() == pytest.approx(1e-3)


def test_restart_forgets_the_past():
    time = Time()
    pacer = Pacer(1e-3, time)
    run(pacer, time, [5e-3, 1e-4])
    assert pacer.overruns > 0
    pacer.restart()
    assert (pacer.overruns, pacer.worst, pacer.remaining()) == (0, 0.0, pytest.approx(1e-3))
