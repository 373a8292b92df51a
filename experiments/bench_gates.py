"""What bars a controller from leading: an unstable loop in the linear proof, or an unstable episode.

The proof (experiments.robustness) looks at every speed, operating point and arm of the nominal plant;
episodes add drawn plants, cars and everything non-linear. Neither counts where the reference itself,
perfectly tracked, is unstable: that is the reference's property, not the controller's fault.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any

import controllers
from experiments.assessment import Assessment, assess
from experiments.bench_cases import Maker
from experiments.robustness import safe
from steer_env.plants import PLANTS, Reference

Result = dict[str, Any]
Advance = Callable[..., None]
QUICK_KMH = (75.0,)
# Arms that tuning looks at, of those that the proof does: the lightest, the stiffest and the robot.
TUNING_ARMS = ("hands_off", "tense", "robot")


def gates_of(
    names: Sequence[str],
    reference: Reference,
    results: Sequence[Result],
    makers: Mapping[str, Maker],
    quick: bool = False,
    advance: Advance = lambda *_, **__: None,
) -> tuple[dict[str, list[str]], dict[str, Any]]:
    """(Why each controller is unsafe, by name; the proof as plain values for scores.json)."""
    proof: list[dict[str, Any]] = []
    gates: dict[str, list[str]] = {}
    by_system: list[dict[str, Any]] = []
    weak: set[tuple[Any, ...]] = set()
    for name in names:
        make = makers.get(name) or partial(controllers.make, name)
        gates[name] = []
        for plant, causality in product(PLANTS, controllers.CAUSALITIES):
            found = proved(make, plant, causality, reference, QUICK_KMH if quick else None)
            if not found:
                continue
            gate = safe(found)
            gates[name] += gate.failures
            by_system.append({"controller": name, "plant": plant, "causality": causality, **gate._asdict()})
            proof += [{"controller": name, **a._asdict()} for a in found]
            weak |= {_place(a._asdict()) for a in found if not a.reference_stable}
        advance(note=f"{name}: proof")
    for name in names:
        gates[name] += unstable_episodes(name, results, weak)
    return gates, {"gates": by_system, "robustness": proof}


def proved(
    make: Maker, plant: str, causality: str, reference: Reference, speeds_kmh: Sequence[float] | None = None
) -> list[Assessment]:
    """Assessments of a controller; none where it has no pure law that could be linearised."""
    controller = make(PLANTS[plant], reference, causality)
    if not hasattr(controller, "law"):
        return []
    return assess(lambda *_: controller, plant, causality, reference, speeds_kmh)


def unstable_episodes(name: str, results: Sequence[Result], weak: set[tuple[Any, ...]]) -> list[str]:
    """The scored episodes of a controller that turned unstable, in words, without those at ``weak`` places."""
    return [
        f"{case['plant']} {case['causality']}, {case['speed_kmh']:g} km/h, {case['manoeuvre']}, {case['arm']}: "
        f"unstable in simulation (draw {case['draw']})"
        for result in results
        for case in [result["case"]]
        if case["controller"] == name and case["split"] == "test" and not result["stable"] and _place(case) not in weak
    ]


def _place(record: Mapping[str, Any]) -> tuple[Any, ...]:
    return record["plant"], record["causality"], float(record["speed_kmh"]), record["arm"]
