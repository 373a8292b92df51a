"""Coupled-stability radius: how much more (or less) of an arm a loop bears."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from steer_env.physics.driver import Driver

SCALES = (1.0, 0.0, 0.125, 0.25, 0.5, 1.5, 2.0, 3.0, 4.0)  # of an arm; the first is the arm itself
HALVINGS = 5  # of the step between two scales


def scaled_arm(arm: Driver, scale: float) -> Driver:
    """The arm with inertia, damping and stiffness times ``scale``."""
    return arm._replace(J=scale * arm.J, b=scale * arm.b, k=scale * arm.k)


def radius(growths: Sequence[float], growth_at: Callable[[float], float]) -> float:
    """The smallest scale that destabilises, from the growths at SCALES and, between two of them, by halving.

    0 where no arm at all does, the largest of SCALES where none of them does.
    """
    pairs = sorted(zip(SCALES, growths, strict=True))
    unstable = [k for k, (_, growth) in enumerate(pairs) if growth >= 0.0]
    if not unstable:
        return pairs[-1][0]
    if unstable[0] == 0:
        return 0.0
    low, high = pairs[unstable[0] - 1][0], pairs[unstable[0]][0]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if growth_at(middle) >= 0.0 else (middle, high)
    return high
