"""Exponential, sine and cosine from additions and products, so that many at once compile to vector code.

Those of ``math`` are calls into the C library: compiled loops around them run one value at a time, and their last bit
differs between machines. These give the same bits everywhere. The polynomials interpolate at Chebyshev points.
"""

from __future__ import annotations

import math
from typing import Any

from steer_env.physics._jit import scalar, when_compiling

LARGEST_ANGLE = 1e6  # rad: up to here sine and cosine keep their error
LEAST = -700.0  # below it exp(-700) = 1e-304 is returned: nothing beside 1, and still a normal number
_TO_INTEGER = 6755399441055744.0  # 1.5 x 2^52: added and taken away again, it rounds to an integer
_LOG2_E, _LN_2 = 1.4426950408889634, 0.6931471805599453
_TWO_PER_PI = 0.6366197723675814
# Their sum is pi / 2; the first two have 33 bits, so that their products with a whole number below 2^20 are exact.
_RIGHT_ANGLE_1, _RIGHT_ANGLE_2, _RIGHT_ANGLE_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21


def power_of_two(n: float) -> float:
    """2^n for a whole number n from -1022 to 1023; NaN for NaN."""
    return math.ldexp(1.0, int(n)) if n == n else n


def _tell_power_of_two() -> None:
    from llvmlite import ir
    from numba.core import types
    from numba.extending import intrinsic, overload

    @intrinsic
    def from_bits(typing_context: Any, n: Any) -> Any:
        """N lands in the lowest bits of n + 1.5 x 2^52; moved to where the exponent is, it makes 2^n."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            word = ir.IntType(64)
            shifted = builder.bitcast(builder.fadd(arguments[0], ir.Constant(ir.DoubleType(), _TO_INTEGER)), word)
            exponent = builder.add(builder.shl(shifted, word(52)), word(1023 << 52))
            return builder.bitcast(exponent, ir.DoubleType())

        return types.float64(types.float64), generate

    @overload(power_of_two)
    def _power_of_two_compiled(n):  # type: ignore[no-untyped-def]
        return lambda n: from_bits(n)  # type: ignore[call-arg]


when_compiling(_tell_power_of_two)


@scalar
def exponential(x: float) -> float:
    """exp(x) for x up to 700; exactly 1 at 0. Its relative error is at most (2 + 1.2 |x|) 2^-53.

    x / ln 2 = n + f with |f| <= 1/2, and 2^f = 1 + f ln 2 + f^2 q(f). The polynomial q, which errs by 3e-17, is summed
    in pairs, which a processor does at the same time.
    """
    scaled = (LEAST if x < LEAST else x) * _LOG2_E
    n = (scaled + _TO_INTEGER) - _TO_INTEGER
    f = scaled - n
    f2 = f * f
    low = (0.24022650695910075 + 0.05550410866482158 * f) + (0.009618129107618634 + 0.0013333558146423196 * f) * f2
    high = (0.0001540353042485199 + 1.5252733820836028e-05 * f) + (
        1.3215451576896747e-06 + 1.017806723742614e-07 * f
    ) * f2
    top = 7.070990735876959e-09 + 4.4541102704477153e-10 * f
    f4 = f2 * f2
    q = low + (high + top * f4) * f4
    return (1.0 + (f * _LN_2 + f2 * q)) * power_of_two(n)


@scalar
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle in rad, within 2e-16 up to LARGEST_ANGLE.

    The angle is n right angles and a rest of at most pi / 4, whose sine and cosine are polynomials; n modulo 4 says
    which of the two is which, and their signs.
    """
    n = (angle * _TWO_PER_PI + _TO_INTEGER) - _TO_INTEGER
    turn = n - 4.0 * ((n * 0.25 + _TO_INTEGER) - _TO_INTEGER)  # -2, -1, 0, 1 or 2
    r = ((angle - n * _RIGHT_ANGLE_1) - n * _RIGHT_ANGLE_2) - n * _RIGHT_ANGLE_3
    z = r * r
    z2 = z * z
    s_low = -0.16666666666666666 + 0.008333333333330925 * z
    s_middle = -0.00019841269836722418 + 2.755731608381636e-06 * z
    s_high = -2.5051127944014188e-08 + 1.5917848524808262e-10 * z
    c_low = 0.041666666666666664 - 0.0013888888888887382 * z
    c_middle = 2.480158729874307e-05 - 2.7557317260008837e-07 * z
    c_high = 2.0876143827993133e-09 - 1.1382456778061306e-11 * z
    s = r + r * z * (s_low + (s_middle + s_high * z2) * z2)
    c = 1.0 - (0.5 * z - z2 * (c_low + (c_middle + c_high * z2) * z2))
    swapped, half_turn = abs(turn) == 1.0, abs(turn) == 2.0
    sine, cosine = (c, s) if swapped else (s, c)
    return (
        -sine if turn == -1.0 or half_turn else sine,
        -cosine if turn == 1.0 or half_turn else cosine,
    )
