"""Coupled stability of a law that acts anew only every few periods, such as a policy at 200 Hz in a loop at 1 kHz.

One period of it is not like the next, so a loop has no modes of one period. It has them of one whole
step (Floquet): the matrices of its periods, multiplied in order, carry the loop from step to step, and
it is stable where all their eigenvalues lie inside the unit circle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import product

import numpy as np

from experiments.law_half import linearisable, settled, slopes_at
from experiments.linear_loop import AT_REST, Complexes, Half, closed_loop, environment_half, modes
from experiments.operating_points import POINTS, Place, place_of
from experiments.perfect_tracking import growths
from steer_env.envs.layout import PERIOD
from steer_env.interface import Controller
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

Make = Callable[[Plant, Reference, str], Controller]


def unstable_places(
    make: Make, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float]
) -> list[str]:
    """Places (speed, operating point, arm) with a stable reference at which the loop grows, in words.

    Empty for what is no periodic law: experiments.robustness proves those.
    """
    controller = make(PLANTS[plant], reference, causality)
    if linearisable(controller) or not hasattr(controller, "law"):
        return []
    controller.reset(PERIOD)
    found = []
    for speed, point in product(speeds_kmh, POINTS):
        place = place_of(PLANTS[plant], causality, reference, speed, point)
        arms = list(DRIVERS.values())
        rates, own = step_modes(controller, place, arms), growths(place, arms)
        for name, loop, growth in zip(DRIVERS, rates, own, strict=True):
            if growth < 0.0 and loop.size and loop[0].real >= 0.0:
                what = f"grows with {loop[0].real:.1f} /s at {loop[0].imag / (2.0 * np.pi):.1f} Hz"
                found.append(f"{plant} {causality}, {speed:g} km/h, {point}, {name}: {what}")
    return found


def step_modes(controller: Controller, place: Place, arms: Sequence[Driver]) -> list[Complexes]:
    """Modes of the loop with each arm in rad/s, fastest growing first; frequencies beyond half the step rate fold.

    The controller has just been reset; its state has a field ``tick`` that counts the periods of a step.
    """
    state, observation = settled(controller, place)
    environment = environment_half(place, arms)
    count = int(getattr(controller, "decimation", 1))
    loops = [
        closed_loop(environment, slopes_at(controller.law, controller.parameters, phase, observation))
        for phase in (state._replace(tick=float(k)) for k in range(count))
    ]
    carried = reduce(lambda before, loop: loop.A @ before, loops[1:], loops[0].A)
    first = loops[0]
    found = []
    for rates in modes(Half(carried, first.B, first.C, first.D)):
        slower = rates / count
        found.append(slower[np.abs(slower) > AT_REST])
    return found
