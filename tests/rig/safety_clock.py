"""An armed safety layer on virtual time in whole microseconds, so that no sum of periods drifts over a limit."""

from steer_env.rig.safety import HEALTHY_CYCLES, SafetyLayer
from steer_env.rig.safety_limits import Limits, Measurement

PERIOD = 1e-3
RATED = 7.5
# Rates are checked apart from the cap: let it be reached within a cycle. These wheels stand still under torque.
FAST = Limits(rate_up=1e5, rate_down=1e5, window_change=50.0, frozen_torque=50.0, torque_mismatch=50.0)
REST = Measurement(0.0, 0.0, 0.0, 0.0, 0.0)


class Clock:
    """Virtual time in whole microseconds, so that no sum of periods drifts over a limit."""

    def __init__(self, start_us=5_000_000):
        self.us = start_us

    def tick(self, us=1000):
        self.us += us
        return self.us / 1e6


def at(clock, **changes):
    return REST._replace(time=clock.us / 1e6, **changes)


def armed(limits=FAST, clock=None, **options):
    """An armed layer and its clock."""
    layer, clock = SafetyLayer(RATED, limits, PERIOD, **options), clock or Clock()
    layer.unlock(clock.tick())
    for count in range(HEALTHY_CYCLES):
        now = clock.tick()
        changes = {"counter": count % options["counter_modulus"]} if options else {}
        assert layer.filter(0.0, at(clock, **changes), now) == 0.0
    assert layer.arm(clock.tick(500)) == ""
    clock.us -= 500
    return layer, clock


def ask(layer, clock, torque, us=1000, **changes):
    now = clock.tick(us)
    return layer.filter(torque, at(clock, **changes), now)
