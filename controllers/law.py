"""A control law, its design and its present state, as one Controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

from steer_env.errors import InputError
from steer_env.interface import Law, Observation
from steer_env.units import check_ranges

PERIOD = 1e-3  # s, until reset() says otherwise


class Factor(NamedTuple):
    """A gain given as a share of what the design formula gives, so that it suits other plants and periods."""

    share: float


Gain = float | Factor


class LawController:
    """Implements ``steer_env.interface.Controller`` around a pure law.

    ``design(period)`` gives the parameters for a control period in s; ``start`` is the state after
    a reset.
    """

    def __init__(self, law: Law, design: Callable[[float], Any], start: Any) -> None:
        self.law = law
        self._design = cache(design)
        self._start = start
        self.reset(PERIOD)

    def reset(self, period: float) -> None:
        """Forget the past and design for control periods of ``period`` seconds, once for each."""
        self.parameters = self._design(period)
        self._state = self._start

    def state(self) -> Any:
        """The law's present state."""
        return self._state

    def __call__(self, observation: Observation) -> float:
        """Motor torque in N m for this period."""
        torque, self._state = self.law(observation, self._state, self.parameters)
        return torque


def with_gains(parameters: Any, gains: Mapping[str, Gain], where: str) -> Any:
    """Parameters with some fields replaced; an unknown name or a bad value is an InputError.

    A ``Factor`` multiplies what stands in the field.
    """
    for name in gains:
        if name not in parameters._fields:
            raise InputError(where, f"there is no gain {name!r}", f"use one of {', '.join(parameters._fields)}")
    changed = parameters._replace(
        **{
            name: getattr(parameters, name) * gain.share if isinstance(gain, Factor) else float(gain)
            for name, gain in gains.items()
        }
    )
    check_ranges(changed, where)
    return changed
