"""Which systems (plant and causality) a benchmark ranks over: those that every chosen controller is made for.

A classical law designs itself for each of the four. A learned policy was trained for one, and only what was driven on
the same systems can be compared: so a run with a policy is a run on the policy's systems, for all controllers alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from typing import Any

import controllers
from controllers import policy_file
from steer_env.errors import InputError
from steer_env.plants import PLANTS

System = tuple[str, str]  # plant, causality
SYSTEMS: tuple[System, ...] = tuple(product(PLANTS, controllers.CAUSALITIES))


def system_of(task: str) -> System:
    """The system of a task such as "SbW-Impedance"; InputError for any other."""
    plant, _, causality = task.partition("-")
    if (plant, causality.lower()) not in SYSTEMS:
        raise InputError("--system", f"{task!r} is not known", f"use one of {', '.join(map(task_of, SYSTEMS))}")
    return plant, causality.lower()


def task_of(system: System) -> str:
    """A system's name as in the environments' ids: "SbW-Impedance"."""
    return f"{system[0]}-{system[1].capitalize()}"


def words_of(systems: Iterable[Sequence[str]]) -> str:
    """Systems in words: "SbW impedance, SbW admittance"."""
    return ", ".join(" ".join(system) for system in systems)


def reasons_of(left_out: Sequence[Mapping[str, Any]]) -> str:
    """The systems that are left out and why, in words."""
    found: dict[str, list[System]] = {}
    for record in left_out:
        found.setdefault(record["why"], []).append((record["plant"], record["causality"]))
    return "; ".join(f"{words_of(systems)} ({why})" for why, systems in found.items())


def ranked(
    names: Sequence[str], asked: Sequence[System] = (), there: Sequence[System] = SYSTEMS
) -> tuple[tuple[System, ...], list[dict[str, Any]]]:
    """(Systems that all of the controllers are made for, {plant, causality, why} of those that are left out).

    ``asked`` keeps these alone, ``there`` is all that can be driven. InputError where nothing is left, or where a
    controller is not made for what is asked for.
    """
    made_for = {name: policy_file.systems_of(name) for name in names}
    found, left_out = [], []
    for system in there:
        lacking = [name for name, own in made_for.items() if own is not None and system not in own]
        if asked and system not in asked:
            left_out.append((system, "not asked for"))
        elif lacking and asked:
            own = words_of(made_for[lacking[0]] or ())
            what = f"{lacking[0]} is made for {own} alone, not for {' '.join(system)}"
            raise InputError("--system", what, "leave that system or that controller out")
        elif lacking:
            why = "; ".join(f"{name} is made for {words_of(made_for[name] or ())} alone" for name in lacking)
            left_out.append((system, why))
        else:
            found.append(system)
    if not found:
        what = f"there is no system that all of {', '.join(names)} are made for ({words_of(there)} can be driven)"
        raise InputError("--controller", what, "score them apart from each other")
    return tuple(found), [{"plant": p, "causality": c, "why": why} for (p, c), why in left_out]


def policies_of(names: Sequence[str]) -> list[dict[str, Any]]:
    """What the policies among the controllers are, one record for each system that one is made for."""
    return [
        {
            "controller": name, "plant": plant, "causality": causality, "base": policy.base,
            "step_ms": 1e3 * policy.sample_time, "authority_Nm": policy.authority,
            "least_share": min(share for _, share in policy.shares),
            "seed": policy.training.get("seed"), "training_steps": policy.training.get("steps"),
        }
        for name in names
        for plant, causality in policy_file.systems_of(name) or ()
        for policy in [policy_file.named(name, plant, causality)]
    ]  # fmt: skip
