"""What bars a controller from leading: an unstable loop in the linear proof, or an unstable episode.

The proof (experiments.robustness) looks at every speed, operating point and arm of the nominal plant;
episodes add drawn plants, cars and everything non-linear. Neither counts where the reference itself,
perfectly tracked, is unstable: that is the reference's property, not the controller's fault.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import controllers
from experiments import robustness
from experiments.bench_cases import Maker
from experiments.bench_systems import SYSTEMS, System
from experiments.law_half import has_law, law_half
from experiments.linear_loop import Half, closed_loop, environment_half, modes
from experiments.operating_points import POINTS, Place, place_of
from experiments.perfect_tracking import growths
from steer_env.plants import DRIVERS, PLANTS, Reference

Result = dict[str, Any]
Advance = Callable[..., None]
Where = tuple[str, str, float, str]  # plant, causality, km/h, arm


def gates_of(
    names: Sequence[str],
    reference: Reference,
    results: Sequence[Result],
    makers: Mapping[str, Maker],
    quick: bool = False,
    jobs: int = 1,
    advance: Advance = lambda *_, **__: None,
    systems: Sequence[System] = SYSTEMS,
) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """(Why each controller is unsafe, by name; the proof as plain values for scores.json)."""
    speeds = tuple((robustness.QUICK_KMH,) if quick else (row.speed_kmh for row in reference.file.rows))
    first = systems[0]

    def proven(make: Maker) -> bool:
        return has_law(make(PLANTS[first[0]], reference, first[1]))

    plain = tuple(name for name in names if name not in makers and proven(partial(controllers.make, name)))
    own = {name: make for name, make in makers.items() if proven(make)}
    work = [robustness.System(plant, causality, plain, reference, speeds) for plant, causality in systems]
    found: list[list[robustness.Findings]] = []
    for done in robustness.each_system(work, jobs) if plain else ():
        found.append(done)
        advance(note="proof")
    for name, make in own.items():
        found.append([robustness.findings_of(name, make, *system, reference, speeds) for system in systems])
    proof = robustness.summary_of(found, reference.source)
    weak = {_place(a) for a in proof["assessments"] if not a["reference_stable"]}
    gates = {name: [*_failures(name, proof), *unstable_episodes(name, results, weak)] for name in names}
    return gates, {key: proof[key] for key in ("limits", "gates", "confirmations", "assessments")}


def unstable_episodes(name: str, results: Sequence[Result], weak: set[Where]) -> list[str]:
    """The scored episodes of a controller that turned unstable, in words, without those at ``weak`` places."""
    return [
        f"{case['plant']} {case['causality']}, {case['speed_kmh']:g} km/h, {case['manoeuvre']}, {case['arm']}: "
        f"unstable in simulation (draw {case['draw']})"
        for result in results
        for case in [result["case"]]
        if case["controller"] == name and case["split"] == "test" and not result["stable"] and _place(case) not in weak
    ]


def unstable_share(
    make: Maker, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float], late: int = 0
) -> float:
    """Share of places (speed, operating point, arm) with a stable reference at which the loop is unstable.

    The hardware's commands are ``late`` periods later than the controller was told.
    """
    controller = make(PLANTS[plant], reference, causality)
    judged = unstable = 0
    for speed, point in product(speeds_kmh, POINTS):
        place, environment, own = _surroundings(plant, causality, reference, speed, point, late)
        loops = modes(closed_loop(environment, law_half(controller, place)))
        for loop, growth in zip(loops, own, strict=True):
            judged += growth < 0.0
            unstable += growth < 0.0 and bool(loop.size) and loop[0].real >= 0.0
    return unstable / max(judged, 1)


_kept: dict[tuple[Any, ...], tuple[Place, Half, list[float]]] = {}


def _surroundings(
    plant: str, causality: str, reference: Reference, speed_kmh: float, point: str, late: int
) -> tuple[Place, Half, list[float]]:
    """What does not depend on the controller: place, environments with every arm, the reference's own growths."""
    key = (plant, causality, reference.table.tobytes(), speed_kmh, point, late)
    if key not in _kept:
        told, arms = PLANTS[plant], list(DRIVERS.values())
        motor = told.motor._replace(dead_time=told.motor.dead_time + late)
        place = place_of(told, causality, reference, speed_kmh, point, replace(told, motor=motor))
        _kept[key] = place, environment_half(place, arms), growths(place, arms).tolist()
    return _kept[key]


def _failures(name: str, proof: Mapping[str, Any]) -> list[str]:
    return [reason for gate in proof["gates"] if gate["controller"] == name for reason in gate["failures"]]


def _place(record: Mapping[str, Any]) -> Where:
    return record["plant"], record["causality"], float(record["speed_kmh"]), record["arm"]
