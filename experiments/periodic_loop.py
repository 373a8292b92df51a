"""Coupled stability of a law that acts anew only every few periods, such as a policy at 200 Hz in a loop at 1 kHz.

One period of it is not like the next, so a loop has no modes of one period. It has them of one whole
step (Floquet): the matrices of its periods, multiplied in order, carry the loop from step to step, and
it is stable where all their eigenvalues lie inside the unit circle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
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
    return [
        f"{plant} {causality}, {speed:g} km/h, {point}, {arm}: "
        f"grows with {mode.real:.1f} /s at {mode.imag / (2.0 * np.pi):.1f} Hz"
        for (speed, point, arm), mode in growing(controller, plant, causality, reference, speeds_kmh).items()
    ]


def growing(
    controller: Controller, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float], late: int = 0
) -> dict[tuple[float, str, str], complex]:
    """(Speed in km/h, operating point, arm) -> fastest growing mode in rad/s, where the reference itself is stable.

    The hardware's commands are ``late`` periods later than the controller was told.
    """
    told, arms = PLANTS[plant], list(DRIVERS.values())
    hardware = replace(told, motor=told.motor._replace(dead_time=told.motor.dead_time + late))
    controller.reset(PERIOD)
    found = {}
    for speed, point in product(speeds_kmh, POINTS):
        place = place_of(told, causality, reference, speed, point, hardware)
        rates, own = step_modes(controller, place, arms), growths(place, arms)
        for name, loop, growth in zip(DRIVERS, rates, own, strict=True):
            if growth < 0.0 and loop.size and loop[0].real >= 0.0:
                found[float(speed), point, name] = complex(loop[0])
    return found


def step_modes(controller: Controller, place: Place, arms: Sequence[Driver]) -> list[Complexes]:
    """Modes of the loop with each arm in rad/s, fastest growing first; frequencies beyond half the step rate fold.

    The controller has just been reset; its state has a field ``tick`` that counts the periods of a step.
    """
    state, observation = settled(controller, place)
    environment = environment_half(place, arms)
    count = int(getattr(controller, "decimation", 1))
    phases = [state] if linearisable(controller) else [state._replace(tick=float(k)) for k in range(count)]
    loops = [
        closed_loop(environment, slopes_at(controller.law, controller.parameters, phase, observation))
        for phase in phases
    ]
    carried = reduce(lambda before, loop: loop.A @ before, loops[1:], loops[0].A)
    first = loops[0]
    found = []
    for rates in modes(Half(carried, first.B, first.C, first.D)):
        slower = rates / count
        found.append(slower[np.abs(slower) > AT_REST])
    return found
