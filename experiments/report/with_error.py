"""Numbers with their standard errors, to the digits that mean something."""

import math


def with_error(value: float, error: float | None) -> str:
    """A value to two digits of its standard error, with the error: 0.0612 ± 0.0004; four digits without an error."""
    if error is None or not math.isfinite(error) or error <= 0.0 or abs(value) > 1e7 * error:
        return f"{value:.4g}"
    decimals = 1 - math.floor(math.log10(error)) if error < 2.0 * 10 ** math.floor(math.log10(error)) else -math.floor(
        math.log10(error)
    )
    if decimals <= 0:
        step = 10**-decimals
        return f"{round(value / step) * step:d} ± {round(error / step) * step:d}"
    return f"{value:.{decimals}f} ± {error:.{decimals}f}"
