"""Z-width: a bare spring behind a delay by its closed form, and what the reference itself bears."""

from typing import NamedTuple

import numpy as np
import pytest

from controllers.law import LawController
from experiments.z_width import rendered, with_impedance, z_widths
from steer_env.envs.layout import PERIOD
from steer_env.errors import InputError
from steer_env.physics._jit import scalar
from steer_env.plants import DRIVERS, PLANTS, Reference
from steer_env.plants.reference import steady_stiffness
from steer_env.units import from_kmh

REFERENCE = Reference.load("published")
SBW = PLANTS["SbW"]


class Nothing(NamedTuple):
    """The state of a law without memory."""

    unused: float = 0.0


@scalar
def spring(o, x, p):
    return -p * o.pinion_angle, x


def bare_spring(plant, reference, causality):
    """A virtual spring of the reference's stiffness, on the motor and without any other help."""
    speed = from_kmh(75.0)
    stiffness = steady_stiffness(speed, reference.at(speed)) / plant.steering.motor_ratio
    return LawController(spring, lambda period: stiffness, Nothing())


def test_a_bare_spring_is_stable_up_to_damping_over_delay():
    """K < b / T of a mass with damping b behind a delay (Colgate; Gil et al.): catches a delay or a damping lost.

    Nobody holds the wheel and friction slides, so that b is that of the two bearings. T is the angle's
    latency, the motor's dead time, half a period of hold and the current loop's lag.
    """
    s, motor = SBW.steering, SBW.motor
    delay = (SBW.sensors.angle_delay + motor.dead_time + 0.5) * PERIOD + 1.0 / (2.0 * np.pi * motor.bandwidth_Hz)
    limit = (s.b_s + s.b_pin) / delay
    own = steady_stiffness(from_kmh(75.0), with_impedance(REFERENCE, 75.0, 1.0, 1.0).at(from_kmh(75.0)))
    shares = np.array([0.5, 0.9, 0.97, 1.03, 1.1, 2.0])
    factors = tuple(shares * limit / own), (1.0,)
    bears, stable = rendered(
        {"spring": bare_spring}, "SbW", "impedance", REFERENCE, 75.0, factors,
        [DRIVERS["hands_off"]], ["centre_sliding"],
    )  # fmt: skip
    assert bears.all()
    np.testing.assert_array_equal(stable["spring"][:, 0], shares < 1.0)


def test_the_virtual_stiffness_and_damping_are_what_the_factors_say():
    plain, virtual = (with_impedance(REFERENCE, 45.0, *factors).at(from_kmh(45.0)) for factors in ((1, 1), (3, 2)))
    assert steady_stiffness(12.5, virtual) == pytest.approx(3.0 * steady_stiffness(12.5, plain))
    assert virtual.b_ref == pytest.approx(2.0 * plain.b_ref)
    assert steady_stiffness(12.5, plain) == pytest.approx(18.765)
    with pytest.raises(InputError, match="no row at 50"):
        with_impedance(REFERENCE, 50.0, 1.0, 1.0)


def test_the_width_of_the_bare_spring_and_of_a_shipped_controller():
    """The spring bears b / T = 23 N m/rad: of 0.5 to 4 times 35 only the least; a controller its own pair."""
    widths = z_widths(["pid", "spring"], REFERENCE, {"spring": bare_spring})
    found = {(w.plant, w.causality, w.controller): w for w in widths}
    assert len(found) == 2 * 2 * 2
    spring, shipped = (found["SbW", "impedance", name] for name in ("spring", "pid"))
    assert spring.width == pytest.approx(0.25)
    assert (spring.stiffness, spring.damping) == (0.0, 0.0)
    assert spring.width < shipped.width <= 1.0
    assert min(shipped.stiffness, shipped.damping) >= 1.0
