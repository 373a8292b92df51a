"""The exponential function from additions and products, so that many at once compile to vector code.

``math.exp`` is a call into the C library: compiled loops around it run one value at a time, and its last bit differs
between machines. This one gives the same bits everywhere.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, overload

from steer_env.physics._jit import scalar

LEAST = -700.0  # below it exp(-700) = 1e-304 is returned: nothing beside 1, and still a normal number
_TO_INTEGER = 6755399441055744.0  # 1.5 x 2^52: added and taken away again, it rounds to an integer
_LOG2_E = 1.4426950408889634
_LN_2_HIGH, _LN_2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # their sum is ln 2; the first has short mantissa


def power_of_two(n: float) -> float:
    """2^n for a whole number n from -1022 to 1023; NaN for NaN."""
    return math.ldexp(1.0, int(n)) if n == n else n


@intrinsic
def _power_of_two_from_bits(typing_context: Any, n: Any) -> Any:
    """n lands in the lowest bits of n + 1.5 x 2^52; moved to where the exponent is, it makes 2^n."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        shifted = builder.bitcast(builder.fadd(arguments[0], ir.Constant(ir.DoubleType(), _TO_INTEGER)), word)
        exponent = builder.add(builder.shl(shifted, word(52)), word(1023 << 52))
        return builder.bitcast(exponent, ir.DoubleType())

    return types.float64(types.float64), generate


@overload(power_of_two)
def _power_of_two_compiled(n):  # type: ignore[no-untyped-def]
    return lambda n: _power_of_two_from_bits(n)  # type: ignore[call-arg]


@scalar
def exponential(x: float) -> float:
    """exp(x) for x up to 700, within 2 units in the last place; exactly 1 at 0.

    x = n ln 2 + r with |r| <= ln 2 / 2, and exp(r) = 1 + r + r^2 q(r). The polynomial q interpolates at Chebyshev
    points and errs by 2e-17; it is summed in pairs, which a processor does at the same time.
    """
    held = LEAST if x < LEAST else x
    n = (held * _LOG2_E + _TO_INTEGER) - _TO_INTEGER
    r = (held - n * _LN_2_HIGH) - n * _LN_2_LOW
    r2 = r * r
    low = (0.5000000000000001 + 0.16666666666666669 * r) + (0.04166666666662399 + 0.008333333333330051 * r) * r2
    high = (0.0013888888917281794 + 0.00019841269863105968 * r) + (
        2.480152119021773e-05 + 2.7557268378684192e-06 * r
    ) * r2
    top = 2.7620138719733994e-07 + 2.5100424157005067e-08 * r
    r4 = r2 * r2
    q = low + (high + top * r4) * r4
    return (1.0 + (r + r2 * q)) * power_of_two(n)
