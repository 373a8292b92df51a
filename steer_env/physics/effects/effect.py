"""What the catalogue says of one effect: its parameters, where it enters, and what is physically plausible."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

Port = Callable[[Any, Any], float]


@dataclass(frozen=True)
class Plausible:
    """Range of a parameter in its unit within which the effect's name is believed; ``signed``: of either sign."""

    low: float
    high: float
    signed: bool = False

    def holds(self, value: float, slack: float = 0.0) -> bool:
        """Whether a value lies inside the range widened by a relative ``slack``."""
        size = abs(value) if self.signed else value
        edge = slack * max(abs(self.low), abs(self.high)) if self.low <= 0.0 else 0.0
        return self.low * (1.0 - slack) - edge <= size <= self.high * (1.0 + slack) + edge


@dataclass(frozen=True)
class SensorError:
    """What a logger or sensor does to channels: fields of the parameters that delay, scale or shift them."""

    channels: tuple[str, ...]
    delay: str = ""
    gain: str = ""
    offset: str = ""


@dataclass(frozen=True)
class Effect:
    """One row of the catalogue.

    ``parameters`` is a NamedTuple class whose defaults mean "absent": with ``amplitude`` at its default the others do
    nothing. ``plausible`` covers the published parameters; a field without an entry is a shape of ours that is fitted
    but not judged. ``ports`` are pure scalar functions (moment, parameters) -> float by the name of the port where
    the effect enters; ``sensor`` is set instead where it lies in the measurement. ``probes`` are parameter values
    from which the search starts. ``needs`` are channels without which the effect cannot be told. ``bends``: the
    nominal parameters can bend so far to hide it that it must also be searched from where they are believed to be.
    ``size`` of the parameters must be at least ``least_size``, where no single one says how large the effect is.
    """

    name: str
    kind: str
    enters: str
    parameters: Any
    amplitude: str
    plausible: Mapping[str, Plausible]
    probes: tuple[Mapping[str, float], ...]
    ports: Mapping[str, Port] = field(default_factory=dict)
    sensor: SensorError | None = None
    needs: tuple[str, ...] = ()
    shows_in: str = ""
    bends: bool = False
    size: Callable[[Any], float] | None = None
    least_size: float = 0.0

    def absent(self) -> Any:
        """The parameters that switch the effect off."""
        return self.parameters()

    def at(self, values: Mapping[str, float]) -> Any:
        """The parameters with some values set."""
        return self.parameters()._replace(**values)
