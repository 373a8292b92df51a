"""A state machine that tries to talk the safety layer into torque."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from steer_env.rig.safety import HEALTHY_CYCLES, WINDOW, SafetyLayer, State
from steer_env.rig.safety_faults import is_finite
from steer_env.rig.safety_limits import Limits, Measurement
from tests.rig.safety_bench import RATED

ANY = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -0.0, 1e308, -1e308, 5e-324, 10**400, None, "x", True]),
    st.floats(-10.0, 10.0),
)
SANE = st.floats(-3.0, 3.0)


class AnySequence(RuleBasedStateMachine):
    """No sequence of any inputs gives torque unarmed or beyond cap, rate or window; nothing raises."""

    limits = Limits(rate_up=150.0, rate_down=500.0, window_change=1.2)

    @initialize(counted=st.booleans())
    def start(self, counted):
        self.layer = SafetyLayer(RATED, self.limits, 1e-3, 16 if counted else 0)
        self.time, self.count, self.angle, self.rate = 1.0, 0, 0.0, 0.0
        self.history = []  # (time, torque) since armed
        self.last, self.dt = 0.0, 0.0

    def take(self, requested, measured, now):
        was_armed = self.layer.state is State.ARMED
        torque = self.layer.filter(requested, measured, now)
        assert type(torque) is float
        assert abs(torque) <= self.limits.torque_cap
        if torque != 0.0:
            assert was_armed
            assert self.layer.state is State.ARMED
            dt = now - self.last_time
            grown, before = torque, self.last
            if before * torque > 0.0:
                grown = abs(torque) - abs(before)
                assert grown <= self.limits.rate_up * dt + 1e-12
                assert -grown <= self.limits.rate_down * dt + 1e-12
            else:
                assert abs(torque) <= self.limits.rate_up * dt + 1e-12
                assert abs(torque - before) <= self.limits.rate_down * dt + 1e-12
            window = [old for t, old in self.history if t >= now - WINDOW]
            assert torque <= max([0.0, min(window)]) + self.limits.window_change + 1e-12
            assert torque >= min([0.0, max(window)]) - self.limits.window_change - 1e-12
        elif was_armed and self.layer.state is State.ARMED:
            assert abs(self.last) <= self.limits.rate_down * (now - self.last_time) + 1e-12
        if self.layer.state is not State.ARMED:
            self.history = []
        self.last = torque
        if is_finite(now):
            self.last_time = now
        self.history.append((self.time, torque))
        return torque

    @rule(count=st.integers(1, 300), torque=SANE, rate=st.floats(-15.0, 15.0), us=st.integers(100, 1400))
    def healthy(self, count, torque, rate, us):
        for _ in range(count):
            self.time += us * 1e-6
            angle = min(max(self.angle + rate * us * 1e-6, -7.9), 7.9)
            true_rate, self.angle = (angle - self.angle) / (us * 1e-6), angle
            self.count = (self.count + 1) % 16
            measured = Measurement(self.time, angle, true_rate, torque, 0.0, self.count)
            self.take(torque, measured, self.time)

    @rule(values=st.tuples(*[ANY] * 5), requested=ANY, now=ANY)
    def anything(self, values, requested, now):
        self.take(requested, Measurement(*values), now)

    @rule(requested=ANY)
    def bad_request(self, requested):
        self.time += 1e-3
        self.count = (self.count + 1) % 16
        self.take(requested, Measurement(self.time, self.angle, 0.0, 0.0, 0.0, self.count), self.time)

    @rule(lag=st.floats(-0.01, 0.02), gap=st.floats(-0.01, 0.02), torque=SANE)
    def bad_times(self, lag, gap, torque):
        self.time += gap
        self.take(torque, Measurement(self.time - lag, self.angle, 0.0, 0.0, 0.0, 0), self.time)

    @rule(rubbish=st.sampled_from([None, (), 1.0, "frame", [0.0] * 9]))
    def rubbish(self, rubbish):
        self.take(1.0, rubbish, self.time)

    @rule()
    def arm(self):
        if self.layer.arm(self.time) == "":
            self.last_time, self.history = self.time, [(self.time, 0.0)]

    @rule()
    def arm_properly(self):
        self.layer.disarm()
        self.time += 1e-4
        self.layer.unlock(self.time)
        self.healthy(HEALTHY_CYCLES, 0.0, 0.0, 1000)
        assert self.layer.arm(self.time) == ""
        self.last_time, self.history, self.last = self.time, [(self.time, 0.0)], 0.0

    @rule(now=ANY)
    def unlock(self, now):
        self.layer.unlock(now)

    @rule()
    def disarm(self):
        self.layer.disarm()

    @rule()
    def trip(self):
        self.layer.trip("by rule")
        assert self.layer.state is State.TRIPPED

    @invariant()
    def a_trip_has_a_reason(self):
        if hasattr(self, "layer") and self.layer.state is State.TRIPPED:
            assert self.layer.trip_reason


AnySequence.TestCase.settings = settings(max_examples=60, stateful_step_count=25, deadline=None, derandomize=True)
TestAnySequence = AnySequence.TestCase
