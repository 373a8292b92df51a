"""Every fault ends in zero torque at once: each limit one step inside and one step beyond it."""

import math

import pytest

from steer_env.rig.safety import HEALTHY_CYCLES, State
from steer_env.rig.safety_faults import SCORE_LIMIT, LeakyScore, is_finite
from tests.rig.safety_bench import LIMITS, REST, Rig, armed

BAD_NUMBERS = [math.nan, math.inf, -math.inf, None, "1.0", [1.0], 10**400, 1j]


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_what_is_no_finite_number_is_never_passed(bad):
    assert is_finite(bad) is False
    rig = armed()
    assert rig.cycle(bad) == 0.0
    assert rig.tripped("requested torque")


@pytest.mark.parametrize("bad", BAD_NUMBERS)
@pytest.mark.parametrize("field", REST._fields[:5])
def test_a_measurement_with_a_bad_number_trips(field, bad):
    rig = armed()
    assert (
        rig.cycle(**{field: bad}) == 0.0
        if field != "angle"
        else rig.layer.filter(1.0, REST._replace(time=rig.now, angle=bad), rig.now + 1e-3) == 0.0
    )
    assert rig.tripped("measurement is not made of finite numbers")


@pytest.mark.parametrize("bad", BAD_NUMBERS)
def test_a_clock_without_a_number_trips_and_arms_nothing(bad):
    rig = armed()
    assert rig.layer.filter(1.0, REST._replace(time=rig.now), bad) == 0.0
    assert rig.tripped("clock gave no number")
    rig.layer.unlock(bad)
    assert rig.layer.state is State.TRIPPED
    rig.layer.unlock(rig.now)
    for _ in range(HEALTHY_CYCLES):
        rig.cycle(0.0)
    assert "within" in rig.layer.arm(bad)


@pytest.mark.parametrize("measured", [None, (0.0,) * 9, 3.0, "angle"])
def test_something_else_than_a_measurement_trips(measured):
    rig = armed()
    assert rig.layer.filter(1.0, measured, rig.now + 1e-3) == 0.0
    assert rig.tripped("measurement")


FAULTS = [
    ("future", {"age_us": -1}, {"age_us": 0}),
    ("somebody else", {"foreign": True}, {"foreign": False}),
    ("drive", {"drive_on": False}, {"drive_on": True}),
    ("speed limit", {"rate": 20.001}, {"rate": 20.0}),
    ("speed limit", {"rate": -20.001}, {"rate": -20.0}),
    ("jumped", {"angle": 0.0405}, {"angle": 0.0395}),
    ("jumped", {"angle": -0.0405}, {"angle": -0.0395}),
    ("too late", {"us": 10_001}, {"us": 9_999}),
]


@pytest.mark.parametrize(("reason", "bad", "good"), FAULTS)
def test_a_fault_trips_on_its_boundary_and_not_before(reason, bad, good):
    """Each limit one step inside and one step beyond it."""
    rig = armed()
    rig.cycle(angle=0.0)
    assert rig.cycle(**good) != 0.0, rig.layer.trip_reason
    assert rig.layer.state is State.ARMED
    rig = armed()
    rig.cycle(angle=0.0)
    assert rig.cycle(**bad) == 0.0
    assert rig.tripped(reason)


def test_a_measurement_older_than_5_ms_trips():
    for age_us, ok in ((4999, True), (5001, False)):
        rig = Rig()
        rig.layer.unlock(rig.now)
        for _ in range(HEALTHY_CYCLES):
            rig.cycle(0.0, age_us=4990)
        assert rig.layer.arm(rig.now) == ""
        assert (rig.cycle(age_us=age_us) != 0.0) is ok
        assert ok or rig.tripped("stale")


def test_the_clock_must_advance():
    for us in (0, -1):
        rig = armed()
        rig.layer.filter(1.0, REST._replace(time=rig.now - 1e-3), rig.now + us * 1e-6)
        assert rig.tripped("does not advance")
    rig = armed()
    assert rig.cycle(us=1) != 0.0


def test_measurements_must_not_go_back_in_time_but_may_repeat():
    rig = armed()
    assert rig.cycle(age_us=0) != 0.0
    assert rig.cycle(age_us=1000) != 0.0  # the same once more
    assert rig.cycle(age_us=2001) == 0.0
    assert rig.tripped("out of order")


@pytest.mark.parametrize("side", [1, -1])
def test_beyond_the_angle_limit_it_trips(side):
    rig = armed()
    while abs(rig.angle) < 7.99:
        rig.cycle(0.0, angle=rig.angle + side * 0.01, rate=side * 10.0)
    rig.cycle(0.0, angle=side * 8.0)
    assert rig.layer.state is State.ARMED
    assert rig.cycle(0.0, angle=side * 8.001) == 0.0
    assert rig.tripped("angle limit")


@pytest.mark.parametrize("side", [1, -1])
def test_the_driver_overrides_after_a_while(side):
    """Only what lasts: 12 N m for less than 100 ms is a jolt, and an interruption starts the time anew."""
    rig = armed()
    for _ in range(2):
        for _ in range(100):
            rig.cycle(driver_torque=side * 12.001, angle=-rig.angle)
        rig.cycle(driver_torque=side * 12.0, angle=-rig.angle)
    assert rig.layer.state is State.ARMED, rig.layer.trip_reason
    for _ in range(102):
        given = rig.cycle(driver_torque=side * 12.001, angle=-rig.angle)
    assert given == 0.0
    assert rig.tripped("driver")


def test_a_stuck_sensor_trips():
    """Torque on a wheel of which nothing changes, not even the motor's own torque."""
    rig = armed()
    passed = 0
    while rig.cycle(1.0) != 0.0:
        passed += 1
    assert rig.tripped("stuck")
    assert 499 <= passed <= 501


@pytest.mark.parametrize("changes", ["rate", "motor_torque", "angle"])
def test_any_change_of_a_reading_shows_that_the_sensor_lives(changes):
    rig = armed()
    for k in range(700):
        start = 1.0 if changes == "motor_torque" else 0.0
        assert rig.cycle(1.0, **{changes: start + 1e-3 * (k // 400)}) != 0.0


def test_without_torque_a_wheel_may_stand_still():
    rig = armed()
    for _ in range(700):
        rig.cycle(0.29)
    assert rig.layer.state is State.ARMED
    for _ in range(499):
        assert rig.cycle(0.31) != 0.0, "counted from the torque on, not from the last motion on"


def test_angle_and_rate_must_tell_the_same():
    """A stuck angle at 2 rad/s is found when 0.15 rad are missing, counting what is forgotten in 0.2 s."""
    rig = armed()
    rig.cycle(0.0, angle=0.0)
    missing, cycles = 0.0, 0
    while missing * math.exp(-1e-3 / 0.2) + 2e-3 <= 0.15:
        missing = missing * math.exp(-1e-3 / 0.2) + 2e-3
        cycles += 1
    for _ in range(cycles):
        rig.cycle(0.0, rate=2.0)
        assert rig.layer.state is State.ARMED
    rig.cycle(0.0, rate=2.0)
    assert rig.tripped("contradict")


def test_a_true_rate_contradicts_nothing():
    rig = armed()
    for k in range(2000):
        phase = 2.0 * math.pi * 2.0 * k * 1e-3
        rig.cycle(0.1, angle=math.sin(phase), rate=4.0 * math.pi * math.cos(phase))
    assert rig.layer.state is State.ARMED


@pytest.mark.parametrize("given", [1.51, -1.51])
def test_a_motor_that_gives_another_torque_trips(given):
    """0.51 N m too much is found after 30 ms ln(0.51 / 0.01) = 118 ms, 0.49 N m too much never; either sign."""
    sign = math.copysign(1.0, given)
    for excess, ends in ((0.51, True), (0.49, False)):
        rig = Rig(LIMITS._replace(frozen_torque=50.0)).arm().shake(400, sign)
        cycles = 0
        while cycles < 600 and rig.cycle(sign, motor_torque=sign * (1.0 + excess)) != 0.0:
            cycles += 1
        if ends:
            assert rig.tripped("torque that it is told")
            assert 113 <= cycles <= 123
        else:
            assert cycles == 600, rig.layer.trip_reason


def test_a_leaky_score_forgives_now_and_then_but_not_five_misses_on_balance():
    score = LeakyScore()
    assert not any(score.broken_after(missed) for missed in [True, False] * 50)
    assert [score.broken_after(True) for _ in range(7)] == [False] * (SCORE_LIMIT - 1) + [True] * 3
    assert [score.broken_after(False), score.broken_after(True)] == [False, True]
    assert not any(score.broken_after(False) for _ in range(3 * SCORE_LIMIT))
    assert [score.broken_after(True) for _ in range(5)] == [False] * 4 + [True]
    assert [LeakyScore().broken_after(True) for _ in range(3)] == [False] * 3
    fresh = LeakyScore()
    assert [fresh.broken_after(True) for _ in range(5)] == [False] * 4 + [True]
    assert SCORE_LIMIT == 5


def test_late_cycles_are_forgiven_now_and_then():
    rig = armed()
    for k in range(100):
        assert rig.cycle(us=2000 if k % 2 else 1000, angle=1e-4 * (k % 3)) != 0.0
    for _ in range(20):
        assert rig.cycle(us=1499, angle=-rig.angle) != 0.0
    late = [rig.cycle(us=1501, angle=-rig.angle) != 0.0 for _ in range(6)]
    assert late == [True] * 4 + [False] * 2
    assert rig.tripped("too many control cycles")


@pytest.mark.parametrize("kind", ["frozen", "skipping", "checksum"])
def test_a_counter_or_checksum_that_does_not_fit_trips_after_five(kind):
    rig = armed(counter_modulus=16).shake(50)  # three times round: 15 is followed by 0
    given = []
    for k in range(6):
        if kind == "frozen":
            given.append(rig.cycle(counter=3, angle=-rig.angle))
        elif kind == "skipping":
            given.append(rig.cycle(counter=(2 * k) % 16, angle=-rig.angle))
        else:
            given.append(rig.cycle(intact=False, angle=-rig.angle))
    assert rig.tripped("counter or checksum")
    assert 4 <= sum(torque != 0.0 for torque in given) <= 5


def test_without_a_counter_none_is_asked_for_but_a_checksum_still_is():
    rig = armed()
    for k in range(20):
        assert rig.cycle(counter=7 * k, angle=-rig.angle) != 0.0
    assert [rig.cycle(intact=False, angle=-rig.angle) != 0.0 for _ in range(5)] == [True] * 4 + [False]
