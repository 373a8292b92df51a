"""The exponential, sine and cosine that compile to vector code: error bounds, special values, parity."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steer_env.physics._jit import compiled
from steer_env.physics.elementary import LARGEST_ANGLE, LEAST, exponential, power_of_two, sine_cosine

repeatable = settings(derandomize=True, deadline=None, max_examples=2000, database=None)


@compiled
def fill(x, exponentials, sines, cosines):
    for k in range(len(x)):
        exponentials[k] = exponential(min(x[k], 700.0))
        sines[k], cosines[k] = sine_cosine(x[k])


@repeatable
@given(st.floats(-690.0, 690.0))
def test_the_exponential_errs_no_more_than_it_says(x):
    """Catches a wrong coefficient, and a polynomial used beyond its interval. math.exp errs by half a unit itself."""
    assert abs(exponential(x) / math.exp(x) - 1.0) <= (3.0 + 1.2 * abs(x)) * 2.0**-53


@repeatable
@given(st.floats(-LARGEST_ANGLE, LARGEST_ANGLE))
def test_sine_and_cosine_err_no_more_than_they_say(angle):
    """Catches a quadrant taken for its neighbour, and an angle that is reduced by a short pi."""
    sine, cosine = sine_cosine(angle)
    assert sine == pytest.approx(math.sin(angle), abs=2e-16)
    assert cosine == pytest.approx(math.cos(angle), abs=2e-16)


def test_small_angles_keep_their_digits():
    """Near zero the sine is the angle: a relative error, where the bound above allows an absolute one."""
    for angle in np.geomspace(1e-12, 0.7, 200).tolist():
        assert sine_cosine(angle)[0] == pytest.approx(math.sin(angle), rel=4e-16)
        assert sine_cosine(-angle)[0] == -sine_cosine(angle)[0]


def test_special_values():
    """Friction at rest must not creep, and a far overshoot must end in nothing rather than in an overflow."""
    assert exponential(0.0) == exponential(-0.0) == 1.0
    assert exponential(-1e300) == exponential(-math.inf) == exponential(LEAST) < 1e-300
    assert math.isnan(exponential(math.nan))
    assert math.isnan(sine_cosine(math.nan)[0])
    for n in (-1022, -52, -1, 0, 1, 52, 1023):
        assert Fraction(power_of_two(float(n))) == Fraction(2) ** n


def test_machine_code_gives_the_same_bits():
    """Catches a fused product, or vector code that rounds differently from the plain functions."""
    rng = np.random.default_rng(2)
    eighths = np.arange(-40, 41) * 0.25 * math.pi
    x = np.concatenate([rng.uniform(-750.0, 700.0, 3000), rng.normal(0.0, 3.0, 3000), eighths])
    found = np.zeros((3, len(x)))
    fill(x, *found)
    plain = [(exponential(v), *sine_cosine(v)) for v in x.tolist()]
    assert (found == np.array(plain).T).all()
