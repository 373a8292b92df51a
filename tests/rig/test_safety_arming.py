"""Torque comes after two separate acts, and after a trip only by both of them anew."""

import pytest

from steer_env.rig.safety import HEALTHY_CYCLES, SafetyLayer, State
from tests.rig.safety_bench import LIMITS, REST, Rig, armed


def test_one_act_is_not_enough_and_neither_is_the_second_alone():
    rig = Rig()
    assert "unlock first" in rig.layer.arm(rig.now)
    rig.layer.unlock(rig.now)
    assert rig.layer.arm(rig.now + 0.01) == "not enough healthy cycles yet"
    for _ in range(19):
        rig.cycle()
    assert rig.layer.arm(rig.now) == "not enough healthy cycles yet"
    rig.cycle()
    assert rig.layer.arm(rig.now) == ""
    assert rig.layer.state is State.ARMED
    rig.layer.unlock(rig.now)  # nothing: it is armed
    assert rig.layer.state is State.ARMED
    assert "armed" in rig.layer.arm(rig.now)
    assert rig.layer.state is State.ARMED


def test_unhealthy_cycles_keep_it_from_arming_and_say_why():
    rig = Rig()
    rig.layer.unlock(rig.now)
    for _ in range(HEALTHY_CYCLES):
        rig.cycle()
    rig.cycle(drive_on=False)
    assert "drive" in rig.layer.arm(rig.now)
    for _ in range(HEALTHY_CYCLES - 1):
        rig.cycle()
        assert rig.layer.arm(rig.now) != ""
    rig.cycle()
    assert rig.layer.arm(rig.now) == ""


def test_the_second_act_must_follow_soon_and_not_at_once():
    for later, ok in ((0.0, False), (10.0, True), (10.000001, False), (-1.0, False)):
        rig = Rig()
        rig.us = 0
        rig.layer.unlock(0.0)
        for _ in range(HEALTHY_CYCLES):
            rig.cycle()
        assert (rig.layer.arm(later) == "") is ok
        assert (rig.layer.state is State.ARMED) is ok


def test_a_trip_latches_keeps_its_first_reason_and_goes_with_a_fresh_arm():
    rig = armed()
    rig.layer.trip("first")
    rig.layer.trip("second")
    assert rig.tripped("first")
    assert not any(rig.cycle() for _ in range(50))
    assert "unlock first" in rig.layer.arm(rig.now)
    rig.us += 10
    rig.layer.unlock(rig.now)
    assert not any(rig.cycle() for _ in range(50))
    assert rig.layer.trip_reason == "first"
    assert rig.layer.arm(rig.now) == ""
    assert rig.layer.trip_reason == ""
    assert 0.0 < rig.cycle(2.0) <= LIMITS.rate_up * 1e-3 + 1e-12  # from zero again


def test_unlocked_without_cycles_it_can_be_tripped_and_disarmed():
    rig = armed()
    rig.layer.disarm()
    assert rig.layer.state is State.LOCKED
    assert rig.cycle() == 0.0
    rig.layer.unlock(rig.now)
    rig.layer.trip("by hand")
    assert rig.tripped("by hand")
    rig.layer.disarm()
    assert rig.layer.trip_reason == "by hand"


def test_a_long_pause_before_unlocking_is_no_fault():
    """Unlocking forgets: what was before counts neither as a late cycle nor as a jump."""
    rig = armed()
    rig.layer.disarm()
    rig.us += 3_000_000
    rig.angle = 1.0
    rig.arm()
    assert rig.cycle() != 0.0


def test_arming_fills_the_store_and_starts_from_zero():
    rig = armed(LIMITS._replace(energy_store=0.5))
    rig.layer.energy = 0.1
    rig.layer.disarm()
    rig.arm()
    assert rig.layer.energy == 0.5


@pytest.mark.parametrize("torque", [1.0, -1.0])
def test_a_pause_between_arming_and_the_first_cycle_gives_no_step(torque):
    """The time in which nothing was asked for must not be spent as ramp."""
    rig = armed()
    rig.layer.disarm()
    rig.arm()
    assert abs(rig.cycle(torque, us=9000)) <= LIMITS.rate_up * 9e-3 + 1e-12
    rig.layer.disarm()
    rig.arm()
    assert rig.cycle(torque, us=11_000) == 0.0


@pytest.mark.parametrize(("us", "ends"), [(1490, False), (1510, True)])
def test_without_a_word_the_period_is_1_ms(us, ends):
    """Late counts from one and a half periods on."""
    layer, now = SafetyLayer(7.5), 5_000_000
    layer.unlock(now / 1e6)
    for _ in range(60):
        now += us
        layer.filter(0.0, REST._replace(time=now / 1e6), now / 1e6)
    assert (layer.arm(now / 1e6) != "") is ends
