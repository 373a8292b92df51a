"""What the gap workflow found, and the document that gap.json holds (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.frf import Floats
from identification.gap.fit import Judge
from identification.gap.next_measurement import Advice
from identification.gap.symptoms import Symptom, Trace
from identification.gap.verdict import Judged, Search

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter of an effect with its 95 % interval, in its unit."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Named:
    """An effect that is named, with the probability that the name is right."""

    name: str
    probability: float
    parameters: Mapping[str, Parameter]


@dataclass(frozen=True)
class ChannelGap:
    """Held-out error of one channel before and after, and its noise, over the rms of the measured signal."""

    before: float
    after: float
    noise: float


@dataclass(frozen=True)
class GapResult:
    """The verdict and everything that it rests on.

    ``before`` and ``after`` are held-out records simulated by the nominal and by the extended model; ``levels`` is
    the power of what may be noise or model error. ``rivals`` lists the candidates as ranked.
    """

    kind: str
    verdict: str
    reason: str
    effects: tuple[Named, ...]
    channels: Mapping[str, ChannelGap]
    symptoms: tuple[Symptom, ...]
    ambiguous_with: tuple[str, ...]
    advice: Advice | None
    advice_why: str
    noise_from_repeats: bool
    search: Search
    judge: Judge
    held: Judge
    before: tuple[Trace, ...]
    after: tuple[Trace, ...]
    notes: tuple[str, ...] = field(default=())

    @property
    def present(self) -> dict[str, dict[str, float]]:
        """The named effects as parameters, for a simulation."""
        return {e.name: {name: p.value for name, p in e.parameters.items()} for e in self.effects}

    def total(self, which: str) -> float:
        """Root mean square over the channels of ``before``, ``after`` or ``noise``."""
        return float(np.sqrt(np.mean([getattr(gap, which) ** 2 for gap in self.channels.values()])))

    def document(self) -> dict[str, Any]:
        """The content of gap.json."""
        return {
            "schema_version": SCHEMA_VERSION,
            "kind": self.kind,
            "verdict": self.verdict,
            "reason": self.reason,
            "effects": [
                {
                    "name": e.name,
                    "probability": _digits(e.probability),
                    "parameters": {
                        name: {"value": _digits(p.value), "ci95": [_digits(p.low), _digits(p.high)]}
                        for name, p in e.parameters.items()
                    },
                }
                for e in self.effects
            ],
            "gap": {
                "metric": "held-out normalised error",
                "before": _digits(self.total("before")),
                "after": _digits(self.total("after")),
                "noise_floor": _digits(self.total("noise")),
                "channels": {
                    name: {"before": _digits(g.before), "after": _digits(g.after), "noise_floor": _digits(g.noise)}
                    for name, g in self.channels.items()
                },
            },
            "symptoms": [{"what": s.what, "where": s.where, "strength": _digits(s.strength)} for s in self.symptoms],
            "ranking": [_ranked(j) for j in self.search.singles],
            "second": [_ranked(j) for j in self.search.pairs],
            "ambiguous_with": list(self.ambiguous_with),
            "next_measurement": None
            if self.advice is None
            else {"manoeuvre": self.advice.manoeuvre, "speed_kmh": self.advice.speed_kmh, "why": self.advice_why},
            "noise": "from repeats" if self.noise_from_repeats else "of the sensors alone: there are no repeats",
            "notes": list(self.notes),
        }


def _ranked(j: Judged) -> dict[str, Any]:
    """One line of the ranking."""
    prefix = f"{j.name}."
    values = j.candidate.solution.values
    return {
        "name": j.name,
        "delta_bic": _digits(j.delta_bic),
        "gap_after": _digits(j.gap_after),
        "held_out_z": _digits(j.z),
        "put_right": _digits(j.fidelity),
        "plausible": j.in_range,
        "parameters": {name[len(prefix) :]: _digits(v) for name, v in values.items() if name.startswith(prefix)},
    }


def _digits(value: float) -> float:
    """Five significant digits: what a reader can use, and the same text on every machine."""
    return float(f"{value:.5g}") if np.isfinite(value) else 0.0


def normalised_gaps(
    before: tuple[Trace, ...], after: tuple[Trace, ...], noise: Mapping[str, float]
) -> dict[str, ChannelGap]:
    """Errors in time by channel, over the rms of the measured signal; ``noise`` is its rms in the channel's unit."""
    found = {}
    for name in dict.fromkeys(name for trace in before for name in trace.measured):
        measured = np.concatenate([t.measured[name][t.keep] for t in before if name in t.measured])
        scale = max(float(np.sqrt(np.mean(measured**2))), 1e-12)
        found[name] = ChannelGap(
            _rms(before, name) / scale, _rms(after, name) / scale, noise.get(name, float("nan")) / scale
        )
    return found


def _rms(traces: tuple[Trace, ...], name: str) -> float:
    parts: list[Floats] = [(t.measured[name] - t.simulated[name])[t.keep] for t in traces if name in t.measured]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
