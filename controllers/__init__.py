"""Control laws, one file each; a law sees an Observation and what it was made with, nothing else.

To add a controller, write ``my_law.py`` with

    make(plant: Plant, reference: Reference, causality: str, **gains: float) -> Controller

and add a row to CONTROLLERS. ``gains`` replace fields of the law's parameter record by name. A law
is a pure function ``(observation, state, parameters) -> (motor torque in N m at the motor's shaft,
new state)`` marked ``@scalar``: plain Python on a bench, compiled in a rollout, the same bits in
both. State is a NamedTuple of floats, so are the parameters except for one array, the reference
over speed. ``law.LawController`` makes a ``Controller`` of the three. Limits sit after a
controller, in the motor and in the rig's safety layer, never inside.

Tests run over the table: protocol, determinism, reset forgets, finite, odd, Python = compiled, and
a stable closed loop with every driver on every plant. ``experiments.coupled_stability`` gives the
eigenvalues of that loop for the design.
"""

from __future__ import annotations

from importlib import import_module

from steer_env.errors import InputError
from steer_env.interface import Controller
from steer_env.plants import Plant, Reference

CONTROLLERS: dict[str, str] = {
    "open_loop_map": "controllers.open_loop_map",
    "pid": "controllers.pid",
    "lead": "controllers.lead",
    "disturbance_observer": "controllers.disturbance_observer",
    "lqg": "controllers.lqg",
}

CAUSALITIES = ("impedance", "admittance")

__all__ = ["CAUSALITIES", "CONTROLLERS", "make"]


def make(name: str, plant: Plant, reference: Reference, causality: str, **gains: float) -> Controller:
    """A controller by its name, for a plant, a reference and "impedance" or "admittance"."""
    if name not in CONTROLLERS:
        raise InputError("controller", f"{name!r} is not known", f"use one of {', '.join(CONTROLLERS)}")
    if causality not in CAUSALITIES:
        raise InputError("causality", f"{causality!r} is not known", f"use one of {', '.join(CAUSALITIES)}")
    controller: Controller = import_module(CONTROLLERS[name]).make(plant, reference, causality, **gains)
    return controller
