"""Exactly on a limit: times and values that floats hold without rounding, so that < and <= are told apart."""

import math

import pytest

from steer_env.rig.safety import HEALTHY_CYCLES
from steer_env.rig.safety_faults import FaultFinder
from steer_env.rig.safety_limits import Limits, Measurement
from tests.rig.safety_bench import LIMITS, Rig

PERIOD = 2.0**-10  # s
EXACT = Limits(
    speed_limit=16.0, jump=2.0**-6, stale_after=2.0**-8, longest_cycle=2.0**-7, override_time=2.0**-4,
    frozen_after=2.0**-2, frozen_torque=0.25, motion_mismatch=0.125, torque_mismatch=50.0,
)  # fmt: skip


class Finder:
    """A fault finder in binary time; ``cycle`` gives its verdict one period (or ``gap``) later."""

    def __init__(self, limits=EXACT, modulus=0):
        self.finder, self.now = FaultFinder(limits, PERIOD, modulus), 1.0
        self.verdict = self.cycle()

    def cycle(self, gap=PERIOD, age=0.0, applied=0.0, **changes):
        self.now += gap
        values = {"angle": 0.0, "rate": 0.0, "motor_torque": 0.0, "driver_torque": 0.0} | changes
        return self.finder.fault(0.0, Measurement(self.now - age, **values), self.now, applied)


def test_the_first_cycle_has_no_past_to_be_judged_by():
    assert Finder().verdict == ""


def test_a_gap_of_exactly_the_longest_cycle_is_allowed():
    assert Finder().cycle(gap=EXACT.longest_cycle) == ""
    assert "too late" in Finder().cycle(gap=EXACT.longest_cycle + 2.0**-20)


def test_exactly_one_and_a_half_periods_are_not_late():
    finder = Finder()
    assert [finder.cycle(gap=1.5 * PERIOD) for _ in range(12)] == [""] * 12


def test_a_measurement_of_exactly_the_age_is_not_stale():
    finder = FaultFinder(EXACT, PERIOD, 0)
    for age, stale in ((2.0**-8, False), (2.0**-8 + 2.0**-20, True)):
        finder.forget()
        assert ("stale" in finder.fault(0.0, Measurement(1.0 - age, 0.0, 0.0, 0.0, 0.0), 1.0, 0.0)) is stale


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_angle_may_step_by_exactly_what_the_speed_limit_and_the_jump_allow(side):
    wide = EXACT._replace(motion_mismatch=5.0)
    assert Finder(wide).cycle(angle=side * 2.0**-5) == ""
    assert "jumped" in Finder(wide).cycle(angle=side * (2.0**-5 + 2.0**-20))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_angle_and_rate_may_differ_by_exactly_the_limit(side):
    """The first difference counts whole, and nothing is there before it."""
    wide = EXACT._replace(jump=1.0)
    assert Finder(wide).cycle(angle=side * 0.125) == ""
    assert "contradict" in Finder(wide).cycle(angle=side * (0.125 + 2.0**-20))


def test_the_driver_overrides_from_exactly_the_time_on():
    finder = Finder()
    verdicts = [finder.cycle(driver_torque=13.0) for _ in range(66)]
    assert verdicts[63:] == ["", "the driver overrides", "the driver overrides"]


def test_a_driver_who_pulls_from_the_first_cycle_on_is_noticed_too():
    rig = Rig(LIMITS)
    rig.layer.unlock(rig.now)
    for _ in range(120):
        rig.cycle(0.0, driver_torque=13.0)
    assert rig.layer.arm(rig.now) == "the driver overrides"


@pytest.mark.parametrize("applied", [0.25, -0.25])
def test_a_sensor_is_stuck_after_exactly_the_time_under_exactly_the_torque(applied):
    finder = Finder()
    finder.cycle()
    verdicts = [finder.cycle(applied=applied) for _ in range(258)]
    assert verdicts[255:] == ["", "the sensor is stuck", "the sensor is stuck"]
    finder = Finder()
    less = applied - 2.0**-20 if applied > 0.0 else applied + 2.0**-20
    assert [finder.cycle(applied=less) for _ in range(300)] == [""] * 300


def test_under_torque_from_the_start_nothing_shows_that_the_sensor_lives():
    """Default deny: a reading that never changed under a torque is not trusted."""
    assert Finder().cycle(applied=0.25) == "the sensor is stuck"


def test_a_measurement_that_comes_again_is_neither_a_miss_nor_a_success():
    """Four repeats between two new ones, with a counter: they may be old, but nothing was lost."""
    rig = Rig(LIMITS._replace(frozen_torque=50.0), counter_modulus=16).arm()
    assert HEALTHY_CYCLES == 20
    for _ in range(10):
        assert rig.cycle(0.5) != 0.0
        last = rig.count - 1
        for age in range(1, 5):
            rig.count = last % 16
            assert rig.cycle(0.5, age_us=1000 * age) != 0.0, rig.layer.trip_reason


@pytest.mark.parametrize("excess", [0.5, -0.5])
def test_the_motor_may_give_exactly_the_tolerance_too_much(excess):
    """What one period leaves of the excess in the mean of 30 ms, to the last bit."""
    share = math.exp(-PERIOD / 0.03)
    limit = (1.0 - share) * 0.5
    assert Finder(EXACT._replace(torque_mismatch=limit)).cycle(motor_torque=excess) == ""
    assert "is told" in Finder(EXACT._replace(torque_mismatch=limit)).cycle(motor_torque=excess * (1.0 + 2.0**-20))
