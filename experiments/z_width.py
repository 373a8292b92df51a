"""Z-width: the virtual springs and dampers that a loop renders stably with every arm (Colgate and Brown).

In place of the reference's own stiffness and damping at a speed stand multiples of both, STIFFNESS and
DAMPING; inertia, assist and the car behind the rack stay. The reference is the linear one, so that a
spring is one at every angle, and the controller is made for it. A pair counts where the loop is stable
at every point and with every arm, and the perfectly tracked reference is too. The width is how many of
the pairs that the reference itself bears the controller bears: the area in logarithmic stiffness and
damping over that of the reference's own set. Pairs beyond what a reference may be are in neither.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import controllers
from experiments.bench_cases import Maker
from experiments.bench_systems import SYSTEMS, System
from experiments.law_half import has_law
from experiments.linear_loop import environment_half
from experiments.operating_points import POINTS, Place, place_of
from experiments.perfect_tracking import growths
from experiments.periodic_half import closed_loops, step_modes
from experiments.periodic_loop import law_halves
from steer_env.envs.layout import PERIOD, STATE
from steer_env.errors import InputError
from steer_env.interface import Controller
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Reference

SPEED_KMH = 75.0  # or the reference's speed that is nearest
STIFFNESS = (0.5, 1.0, 2.0, 4.0)  # of the reference's load
DAMPING = (0.5, 1.0, 2.0, 4.0, 8.0)  # of b_ref
CENTRE = POINTS[:2]  # a linear reference has one slope everywhere

Mask = NDArray[np.bool_]


class ZWidth(NamedTuple):
    """``width`` is a share of the reference's own set; None where that is empty.

    ``stiffness`` and ``damping`` are the largest factors up to which all are stable with the other at 1;
    0: not even the reference itself is.
    """

    plant: str
    causality: str
    controller: str
    width: float | None
    stiffness: float
    damping: float


def z_widths(
    names: Sequence[str],
    reference: Reference,
    makers: Mapping[str, Maker] | None = None,
    advance: Callable[..., None] = lambda *_, **__: None,
    systems: Sequence[System] = SYSTEMS,
) -> list[ZWidth]:
    """Of every controller with a pure law, on each system; makers by name."""
    speed_kmh = min((row.speed_kmh for row in reference.file.rows), key=lambda speed: abs(speed - SPEED_KMH))
    found = []
    for plant, causality in systems:
        makes = {name: (makers or {}).get(name) or partial(controllers.make, name) for name in names}
        makes = {k: make for k, make in makes.items() if has_law(make(PLANTS[plant], reference, causality))}
        own, stable = rendered(makes, plant, causality, reference, speed_kmh)
        for name, mask in stable.items():
            width = float(mask.sum() / own.sum()) if own.any() else None
            reach = _reach(mask[:, DAMPING.index(1.0)], STIFFNESS), _reach(mask[STIFFNESS.index(1.0)], DAMPING)
            found.append(ZWidth(plant, causality, name, width, *reach))
        advance(note="Z-width")
    return found


def rendered(
    makes: Mapping[str, Maker],
    plant: str,
    causality: str,
    reference: Reference,
    speed_kmh: float,
    factors: tuple[Sequence[float], Sequence[float]] = (STIFFNESS, DAMPING),
    arms: Sequence[Driver] = tuple(DRIVERS.values()),
    points: Sequence[str] = CENTRE,
) -> tuple[Mask, dict[str, Mask]]:
    """(Pairs that the reference itself bears, those that each controller bears), [stiffness, damping]."""
    shape = len(factors[0]), len(factors[1])
    own, stable = np.ones(shape, np.bool_), {name: np.ones(shape, np.bool_) for name in makes}
    plain = with_impedance(reference, speed_kmh, 1.0, 1.0)
    for (i, stiffness), (j, damping) in product(enumerate(factors[0]), enumerate(factors[1])):
        virtual = with_impedance(reference, speed_kmh, stiffness, damping)
        if not allowed(virtual):
            own[i, j] = False
            continue
        made: dict[str, Controller] = {name: make(PLANTS[plant], virtual, causality) for name, make in makes.items()}
        for controller in made.values():
            controller.reset(PERIOD)
        for point in points:
            place = on_own_car(
                place_of(PLANTS[plant], causality, virtual, speed_kmh, point),
                place_of(PLANTS[plant], causality, plain, speed_kmh, point),
            )
            environment, bears = environment_half(place, arms), growths(place, arms) < 0.0
            own[i, j] &= bears.all()
            for name, controller in made.items():
                loops = step_modes(closed_loops(environment, law_halves(controller, place)))
                stable[name][i, j] &= all(not loop.size or loop[0].real < 0.0 for loop in loops)
    return own, {name: mask & own for name, mask in stable.items()}


def with_impedance(reference: Reference, speed_kmh: float, stiffness: float, damping: float) -> Reference:
    """The linear reference at one of its speeds, with factors on its load (slow: a spring) and on b_ref."""
    row = next((row for row in reference.file.rows if row.speed_kmh == speed_kmh), None)
    if row is None:
        known = ", ".join(f"{row.speed_kmh:g}" for row in reference.file.rows)
        raise InputError("Z-width", f"the reference has no row at {speed_kmh:g} km/h", f"use one of {known}")
    virtual = row._replace(
        n_t=stiffness * row.n_t,
        c_pin_on=stiffness * row.c_pin_on,
        c_pin_off=stiffness * row.c_pin_off,
        b_ref=damping * row.b_ref,
    )
    file = replace(reference.file, rows=(virtual,), std=({},), frf=({},), extrapolated=((),))
    return replace(reference, file=file, linear=True)


def allowed(reference: Reference) -> bool:
    """Whether all parameters are inside their ranges."""
    try:
        return reference.table.size > 0
    except InputError:
        return False


def on_own_car(place: Place, own: Place) -> Place:
    """``place`` with the car of ``own`` behind its rack: what is rendered changes, the hardware does not."""
    state = place.state.copy()
    state[STATE["car"]] = own.state[STATE["car"]]
    return place._replace(state=state, car_table=own.car_table)


def _reach(stable: Mask, factors: Sequence[float]) -> float:
    """The largest factor up to which, from 1 on, all are stable."""
    reached = 0.0
    for factor, good in zip(factors, stable.tolist(), strict=True):
        if factor >= 1.0 and not good:
            break
        reached = factor if factor >= 1.0 else reached
    return reached
