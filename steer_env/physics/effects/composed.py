"""One compiled sum per port over the effects of a kind, their parameters in one row of floats."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from steer_env.physics._jit import named, scalar
from steer_env.physics.effects.effect import Effect, Port
from steer_env.physics.rows import Layout, Row


class Ports:
    """The mechanical effects of a table: where their parameters lie in a row, and the sum at each port.

    A port is (moment, row or None) -> float; with None the compiler drops it.
    """

    def __init__(self, kind: str, table: Mapping[str, Effect]) -> None:
        self.kind = kind
        self.effects = {name: effect for name, effect in table.items() if effect.ports}
        self.layout = Layout(**{name: effect.parameters for name, effect in self.effects.items()})

    def row(self, present: Mapping[str, Mapping[str, float]]) -> Row:
        """The row in which the effects in ``present`` (name -> parameters) are on; those of sensors have no place."""
        row = np.zeros(self.layout.size)
        for name, effect in self.effects.items():
            row[self.layout[name]] = effect.at(present.get(name, {}))
        return row

    def at(self, port: str) -> Callable[[Any, Any], float]:
        """What all effects together add at a port."""
        total: Callable[..., float] = scalar(_nothing)
        for effect in self.effects.values():
            if port in effect.ports:
                total = _plus(total, self.layout.loader(effect.name), effect.ports[port], f"{self.kind}_{effect.name}")

        def at_port(x: Any, row: Any) -> float:
            if row is None:
                return 0.0
            return total(x, row)

        return scalar(named(at_port, self.kind, port))


def _nothing(x: Any, row: Any) -> float:
    return 0.0


def _plus(before: Callable[..., float], load: Callable[[Row], Any], port: Port, name: str) -> Callable[..., float]:
    def total(x: Any, row: Any) -> float:
        return before(x, row) + port(x, load(row))

    return scalar(named(total, name, port, before))
