"""Control laws, one file each; a law sees an Observation and what it was made with, nothing else.

To add a controller, write ``my_law.py`` with

    make(plant: Plant, reference: Reference, causality: str, **gains: Gain) -> Controller
    TUNABLE: dict[str, tuple[float, float]]    what tuning may change: gain -> (low, high) factor

and add a row to CONTROLLERS. ``gains`` replace fields of the law's parameter record by name; a
``law.Factor`` multiplies the field instead. A law is a pure function ``(observation, state,
parameters) -> (motor torque in N m at the motor's shaft, new state)`` marked ``@scalar``: plain
Python on a bench, compiled in a rollout, the same bits in both. State is a NamedTuple of floats, so
are the parameters except for arrays such as the reference over speed. ``law.LawController`` makes a
``Controller`` of the three. Limits sit after a controller, in the motor and in the rig's safety
layer, never inside; a law may know them to plan with (mpc does), and is limited all the same.

Tests run over the table: protocol, determinism, reset forgets, finite, odd, Python = compiled, and
a stable closed loop with every driver on every plant. Gains come from controllers/tuned where
``steer-env tune`` has made a file, else from the law's own design formulas.

A controller need not be in the table: ``make("my_file.py:MyLaw", ...)`` takes ``MyLaw`` out of a
file and calls it as ``make`` above. ``make("passivity:NAME", ...)`` puts a passivity observer and
controller around any of them; plain "passivity" is that around pid. ``make("policy:FOLDER", ...)`` is what
``steer-env train --out FOLDER`` learned; plain "policy" is the one that is shipped for that plant.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from controllers import policy_file, tuning
from controllers.law import Gain
from controllers.own import inner_of, is_own, load_own
from steer_env.errors import InputError
from steer_env.interface import Controller
from steer_env.plants import Plant, Reference

CONTROLLERS: dict[str, str] = {
    "open_loop_map": "controllers.open_loop_map",
    "pid": "controllers.pid",
    "lead": "controllers.lead",
    "disturbance_observer": "controllers.disturbance_observer",
    "lqg": "controllers.lqg",
    "h_infinity": "controllers.h_infinity",
    "mpc": "controllers.mpc",
    "super_twisting": "controllers.super_twisting",
    "passivity": "controllers.passivity",
}

CAUSALITIES = ("impedance", "admittance")

__all__ = ["CAUSALITIES", "CONTROLLERS", "make", "maker"]


def make(
    name: str, plant: Plant, reference: Reference, causality: str, *, tuned: bool = True, **gains: Gain
) -> Controller:
    """A controller by its name, for a plant, a reference and "impedance" or "admittance".

    ``tuned`` takes the shipped gains, where there are some, for what ``gains`` does not name.
    """
    if causality not in CAUSALITIES:
        raise InputError("causality", f"{causality!r} is not known", f"use one of {', '.join(CAUSALITIES)}")
    shipped = tuning.gains_for(name, plant.name, causality) if tuned and name in CONTROLLERS else {}
    controller: Controller = maker(name)(plant, reference, causality, **{**shipped, **gains})
    return controller


def maker(name: str) -> Callable[..., Any]:
    """The function that makes a controller: of a row of CONTROLLERS, WRAPPER:NAME, policy:FOLDER or FILE.py:NAME."""
    inner = inner_of(name)
    if inner:
        maker(inner)
        return partial(maker(name.partition(":")[0]), inner=inner)
    if policy_file.is_policy(name):
        return partial(import_module("controllers.policy").make, folder=policy_file.folder_of(name))
    if is_own(name):
        return load_own(name)
    if name not in CONTROLLERS:
        raise InputError(
            "controller",
            f"{name!r} is not known",
            f"use one of {', '.join(CONTROLLERS)}, policy, or FILE.py:NAME for your own",
        )
    make_it: Callable[..., Any] = import_module(CONTROLLERS[name]).make
    return make_it
