"""A safety layer on a bench: virtual time in microseconds, and a wheel that a test moves by hand."""

from steer_env.rig.safety import HEALTHY_CYCLES, SafetyLayer, State
from steer_env.rig.safety_limits import Limits, Measurement

LIMITS = Limits()
RATED = 7.5
REST = Measurement(0.0, 0.0, 0.0, 0.0, 0.0)


class Rig:
    """``cycle`` asks for a torque 1 ms later, with a measurement at rest but for what is given."""

    def __init__(self, limits=LIMITS, counter_modulus=0):
        self.layer = SafetyLayer(RATED, limits, 1e-3, counter_modulus)
        self.us, self.count, self.modulus = 7_000_000, 0, counter_modulus
        self.angle, self.given = 0.0, 0.0

    @property
    def now(self):
        return self.us / 1e6

    def cycle(self, torque=1.0, us=1000, age_us=0, **changes):
        self.us += us
        if self.modulus:
            changes.setdefault("counter", self.count)
            self.count = (self.count + 1) % self.modulus
        self.angle = changes.get("angle", self.angle)
        values = {"time": (self.us - age_us) / 1e6, "angle": self.angle, "motor_torque": self.given} | changes
        self.given = self.layer.filter(torque, REST._replace(**values), self.now)
        return self.given

    def arm(self):
        self.us += 10
        self.layer.unlock(self.now)
        for _ in range(HEALTHY_CYCLES):
            assert self.cycle(0.0) == 0.0
        assert self.layer.arm(self.now) == ""
        return self

    def shake(self, cycles, torque=1.0):
        """Torque on a wheel that moves a little, as a held wheel does."""
        for k in range(cycles):
            assert abs(self.cycle(torque, angle=self.angle + (1e-4 if k % 2 else -1e-4))) > 0.0, self.layer.trip_reason
        return self

    def tripped(self, reason):
        return self.layer.state is State.TRIPPED and reason in self.layer.trip_reason


def armed(limits=LIMITS, **options):
    return Rig(limits, **options).arm().shake(20)
