"""Coupled stability of a law that acts anew only every few periods, such as a policy at 200 Hz in a loop at 1 kHz.

One period of it is not like the next, so a loop has modes of one whole step alone (experiments.periodic_half). What
holds for such a law holds for any other: there a step is a period.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from experiments import periodic_half
from experiments.law_half import has_law, periods_in_step, settled, slopes_at
from experiments.linear_loop import Complexes, environment_half
from experiments.operating_points import POINTS, Place, place_of
from experiments.perfect_tracking import growths
from experiments.periodic_half import Halves, closed_loops
from steer_env.envs.layout import PERIOD
from steer_env.interface import Controller
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

Make = Callable[[Plant, Reference, str], Controller]


def law_halves(controller: Controller, place: Place) -> Halves:
    """The law about a place in each period of its step; the controller has just been reset.

    The state of a law with ``decimation`` periods in a step has a field ``tick``, somewhere inside, that counts them.
    """
    state, observation = settled(controller, place)
    count = periods_in_step(controller)
    phases = [state] if count == 1 else [_at_tick(state, float(k)) for k in range(count)]
    return tuple(slopes_at(controller.law, controller.parameters, phase, observation) for phase in phases)


def _at_tick(state: Any, tick: float) -> Any:
    """The same state in another period of the step."""
    changed = {
        name: tick if name == "tick" else _at_tick(value, tick)
        for name, value in zip(state._fields, state, strict=True)
        if name == "tick" or isinstance(value, tuple)
    }
    return state._replace(**changed)


def unstable_places(
    make: Make, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float]
) -> list[str]:
    """Places (speed, operating point, arm) with a stable reference at which the loop grows, in words.

    Empty for what has no pure law.
    """
    controller = make(PLANTS[plant], reference, causality)
    if not has_law(controller):
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
    """Modes of the loop with each arm in rad/s, fastest growing first; frequencies beyond half the step rate fold."""
    return periodic_half.step_modes(closed_loops(environment_half(place, arms), law_halves(controller, place)))
