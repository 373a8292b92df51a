"""What a torque is bounded by, swept one resolution step (1 mN m) around every limit."""

import math
import warnings

import numpy as np
import pytest

from steer_env.errors import InputError
from steer_env.rig.safety import HEALTHY_CYCLES, WINDOW, SafetyLayer, State
from steer_env.rig.safety_limits import Limits, checked_limits, limits_for
from tests.rig.safety_clock import FAST, PERIOD, RATED, REST, Clock, armed, ask, at

LSB = 1e-3  # N m, resolution of the finest protocol


@pytest.mark.parametrize("cap", [0.5, 2.0, 7.5])
def test_no_torque_beyond_the_cap_is_ever_passed(cap):
    """Every request from -1.5 to 1.5 caps in steps of 1 mN m, and the cap itself is reachable to the last bit."""
    layer, clock = armed(FAST._replace(torque_cap=cap))
    for millis in range(-int(1500 * cap), int(1500 * cap) + 1, 1):
        torque = millis * LSB
        given = ask(layer, clock, torque)
        assert given == min(max(torque, -cap), cap)
        assert layer.limited_by == (("cap",) if abs(torque) > cap else ())


@pytest.mark.parametrize("torque", np.arange(-3.0, 3.0, 0.25).tolist())
@pytest.mark.parametrize("state", [State.LOCKED, State.UNLOCKED, State.TRIPPED])
def test_nothing_passes_unless_armed(state, torque):
    layer, clock = SafetyLayer(RATED, FAST, PERIOD), Clock()
    if state is State.UNLOCKED:
        layer.unlock(clock.tick())
    elif state is State.TRIPPED:
        layer.trip("by hand")
    for _ in range(2 * HEALTHY_CYCLES):
        assert ask(layer, clock, torque) == 0.0
    assert layer.state is state


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("start", [0.0, 0.05, 0.5, 1.0, 1.9])
@pytest.mark.parametrize("us", [500, 1000, 1400])
def test_growth_is_bounded_to_one_resolution_step(sign, start, us):
    """|torque| may grow by rate_up dt and not by 1 mN m more."""
    limits = FAST._replace(rate_up=50.0, rate_down=1000.0)
    step = 50.0 * us * 1e-6
    for more, name in ((-LSB, ()), (0.0, ()), (LSB, ("rate",))):
        layer, clock = reached(limits, sign * start)
        given = ask(layer, clock, sign * (start + step + more), us=us)
        assert given == pytest.approx(sign * (start + min(step, step + more)), abs=1e-9)
        if more:  # exactly on the limit, rounding decides whether it counts as limited
            assert layer.limited_by == name


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_decrease_may_be_faster_but_is_bounded_too(sign):
    limits = FAST._replace(rate_up=50.0, rate_down=200.0)
    for more, name in ((-LSB, ("rate",)), (LSB, ())):
        layer, clock = reached(limits, sign * 1.0)
        given = ask(layer, clock, sign * (0.8 + more))
        assert given == pytest.approx(sign * max(0.8, 0.8 + more), abs=1e-9)
        assert layer.limited_by == name


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("start", [0.1, 0.01, 0.0005])
def test_through_zero_it_grows_no_faster_than_from_zero(sign, start):
    """Otherwise a sign change would beat the slower rate: from 0.1 N m to -0.05 at most, not to -0.1."""
    limits = FAST._replace(rate_up=50.0, rate_down=200.0)
    layer, clock = reached(limits, sign * start)
    assert ask(layer, clock, -sign * 2.0) == pytest.approx(-sign * 0.05, abs=1e-9)


def reached(limits, torque):
    """An armed layer whose last torque is ``torque``."""
    layer, clock = armed(limits)
    while ask(layer, clock, torque) != torque:
        pass
    return layer, clock


def test_a_second_call_at_once_gains_nothing():
    """Catches a rate per call instead of per time: sending twice as often must not ramp twice as fast."""
    limits = FAST._replace(rate_up=50.0, rate_down=50.0)
    reach = {}
    for us in (1000, 250):
        layer, clock = armed(limits)
        for _ in range(20_000 // us):
            last = ask(layer, clock, 2.0, us=us)
        reach[us] = last
    assert reach[1000] == pytest.approx(1.0, abs=1e-9)
    assert reach[250] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("base", [0.0, 0.4])
def test_the_window_bounds_growth_within_250_ms(sign, base):
    """At ``base`` for long, then a demand of the cap: base + 1 N m until 250 ms have gone by, to the microsecond."""
    layer, clock = armed(FAST._replace(window_change=1.0))
    for _ in range(400):
        assert ask(layer, clock, sign * base) == sign * base
    left = clock.us  # the last time at the base
    while clock.us < left + 249_000:
        given = ask(layer, clock, sign * 2.0)
        assert given == sign * (base + 1.0)
        assert layer.limited_by == ("window",)
    given = ask(layer, clock, sign * 2.0, us=left + 250_000 - clock.us)
    assert given == sign * (base + 1.0)
    given = ask(layer, clock, sign * 2.0, us=1)
    assert given == pytest.approx(sign * (base + 1.1), abs=1e-6)  # what 1 us of 1e5 N m/s adds


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_from_the_other_side_the_window_counts_from_zero(sign):
    layer, clock = armed(FAST._replace(window_change=1.0))
    for _ in range(20):
        ask(layer, clock, -sign * 0.5)
    assert [ask(layer, clock, sign * 2.0) for _ in range(3)] == [sign * 1.0] * 3


def test_just_armed_the_window_starts_at_zero():
    """Catches an empty window in which a first torque would count as the base."""
    layer, clock = armed(FAST._replace(window_change=1.0, rate_up=800.0))
    given = [ask(layer, clock, 2.0) for _ in range(200)]
    assert given[:3] == [pytest.approx(0.8), 1.0, 1.0]
    assert max(given) == 1.0


def test_any_two_torques_within_the_window_differ_by_no_more_than_it_allows():
    """The definition itself, on random requests at random times: growth from the least to the later ones."""
    rng = np.random.default_rng(3)
    limits = FAST._replace(window_change=0.8)
    layer, clock = armed(limits)
    times, given = [clock.us], [0.0]
    for _ in range(1500):
        wanted = 2.0 * math.sin(clock.us * 1e-6 * rng.uniform(1.0, 60.0)) + rng.normal(0.0, 0.3)
        given.append(ask(layer, clock, wanted, us=int(rng.integers(100, 1500))))
        times.append(clock.us)
    limited = 0
    for later in range(len(given)):
        first = int(np.searchsorted(times, times[later] - round(WINDOW * 1e6)))
        before = given[first : later + 1]
        assert given[later] <= max(min(before), 0.0) + 0.8 + 1e-12
        assert given[later] >= min(max(before), 0.0) - 0.8 - 1e-12
        limited += abs(abs(given[later]) - 0.8) < 1e-12
    assert limited > 100  # the limit was really reached


def test_towards_zero_the_window_never_holds_a_torque_up():
    layer, clock = armed(FAST._replace(window_change=2.0))
    for _ in range(10):
        ask(layer, clock, 2.0)
    layer.limits = layer.limits._replace(window_change=0.1)
    assert ask(layer, clock, 0.0) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_outward_torque_fades_to_zero_at_the_end_stop(side):
    """Straight line over the softening zone; inward torque stays whole."""
    for room, most in ((1.0, 2.0), (0.5, 2.0), (0.25, 1.0), (0.125, 0.5), (0.0, 0.0)):
        layer, clock = brought_to(side * (8.0 - room))
        assert ask(layer, clock, side * 2.0, angle=side * (8.0 - room)) == pytest.approx(side * most, abs=1e-9)
        assert layer.limited_by == (("angle",) if most < 2.0 else ())
        assert ask(layer, clock, -side * 2.0, angle=side * (8.0 - room)) == -side * 2.0


def brought_to(angle, rate=0.0, limits=FAST):
    """An armed layer at an angle, without torque on the way."""
    layer, clock = armed(limits)
    for k in range(1, 1001):
        now = clock.tick()
        layer.filter(0.0, at(clock, angle=angle * k / 1000, rate=angle), now)
    layer.filter(0.0, at(clock, angle=angle, rate=rate), clock.tick())
    assert layer.state is State.ARMED, layer.trip_reason
    return layer, clock


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_driving_torque_fades_to_zero_at_the_speed_limit(side):
    rich = FAST._replace(energy_store=500.0)
    for rate, most in ((10.0, 2.0), (15.0, 2.0), (17.5, 1.0), (19.0, 0.4), (20.0, 0.0)):
        layer, clock = armed(rich)
        assert ask(layer, clock, side * 2.0, rate=side * rate) == pytest.approx(side * most, abs=1e-9)
        assert layer.limited_by == (("speed",) if most < 2.0 else ())
        layer, clock = armed(rich)
        assert ask(layer, clock, -side * 2.0, rate=side * rate) == -side * 2.0


def test_every_limit_yields_to_the_rate():
    """A torque that must vanish at the end stop does so at rate_down, never in a step."""
    layer, clock = brought_to(7.4, limits=FAST._replace(rate_down=200.0, rate_up=200.0))
    while ask(layer, clock, 2.0, angle=7.4) < 2.0:
        pass
    assert ask(layer, clock, 2.0, angle=7.43, rate=20.0) == pytest.approx(1.8)
    assert layer.limited_by == ("speed", "rate")


def test_numbers_of_any_kind_are_taken():
    layer, clock = armed()
    assert ask(layer, clock, np.float32(0.5)) == 0.5
    assert ask(layer, clock, 1) == 1.0
    assert type(ask(layer, clock, np.float64(0.5))) is float


def test_a_cap_above_the_rating_is_refused():
    assert checked_limits(Limits(torque_cap=7.5), 7.5).torque_cap == 7.5
    for cap, rated in ((7.501, 7.5), (2.0, 1.9), (math.nan, 7.5), (60.0, 100.0), (0.0, 7.5)):
        with pytest.raises(InputError, match="torque_cap"):
            SafetyLayer(rated, Limits(torque_cap=cap))
    with pytest.raises(InputError, match="rating"):
        checked_limits(Limits(), math.nan)
    with pytest.raises(InputError, match="rate_down"):
        checked_limits(Limits(rate_up=401.0), 7.5)
    assert checked_limits(Limits(rate_up=400.0), 7.5)
    for narrow in ({"angle_limit": 0.4}, {"speed_limit": 4.0}):
        with pytest.raises(InputError, match="softening"):
            checked_limits(Limits(**narrow), 7.5)
    assert checked_limits(Limits(angle_limit=0.5, speed_limit=5.0), 7.5)


def test_a_raised_cap_brings_rates_window_and_energy_with_it():
    grown = limits_for(6.0, 7.5)
    assert grown == Limits(
        torque_cap=6.0,
        rate_up=300.0,
        rate_down=1200.0,
        window_change=4.5,
        energy_store=18.0,
        energy_income=6.0,
        torque_mismatch=1.5,
    )
    lowered = limits_for(1.0, 7.5, Limits(energy_store=3.0))
    assert (lowered.torque_cap, lowered.energy_store, lowered.rate_up) == (1.0, 1.5, 50.0)
    assert SafetyLayer(7.5).limits == Limits()  # without a word, 2 N m
    assert Limits().torque_cap == 2.0
    with pytest.raises(InputError, match="rating"):
        limits_for(8.0, 7.5)


def test_a_measurement_says_by_itself_that_it_is_sound_and_has_no_counter():
    assert REST[5:] == (-1, True, True, False)


def test_a_new_layer_has_no_reason_and_a_full_store():
    layer = SafetyLayer(RATED)
    assert (layer.state, layer.trip_reason, layer.limited_by, layer.energy) == (State.LOCKED, "", (), 6.0)


def test_nothing_warns():
    """Catches comparisons that numpy answers with a warning instead of a fault."""
    layer, clock = armed()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert layer.filter(np.array([1.0]), at(clock), clock.tick()) == 0.0
    assert layer.state is State.TRIPPED
