"""What an identification hands back: values with errors, the paper's values, and what could not be found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from identification.frf import Complexes, Floats, FrequencyResponse
from identification.steady_state import C_FRIC, SIGMA
from steer_env.plants.reference_file import ReferenceFile
from steer_env.plants.reference_row import KnownVehicle, ReferenceRow

KEYS = tuple(n for n in ReferenceRow._fields if n != "speed_kmh")
LARGEST_RELATIVE_ERROR = 0.5  # a value whose standard error exceeds half of it is not identified
# What the paper selects beforehand (values: field values, our assumption), or what a car may simply not have.
FALLBACK = {"sigma_assist": SIGMA, "c_fric": C_FRIC, "M_fric_C": 0.0}
SIGNED = ("b_ref", "k_gain")  # may be near zero and still be well known


@dataclass(frozen=True)
class Loop:
    """One steady-state run, in rad and N m [n]: measured, by steps I to III, and refined (None where not run)."""

    angle: Floats
    measured: Floats
    stepwise: Floats | None
    refined: Floats | None


@dataclass
class SpeedResult:
    """Everything found at one speed in km/h in one mode, by names of ReferenceRow.

    ``values`` with ``std``; ``frf`` and ``frf_std`` hold the paper's own steps; ``skipped`` maps a step to why it was
    not run; ``notes`` are remarks on single values; ``delays`` in s with errors; ``misfit`` relative errors on held-out
    runs; ``refined`` and ``weights`` are where another mode's refinement of the same runs may start.
    """

    speed_kmh: float
    values: dict[str, float] = field(default_factory=dict)
    std: dict[str, float] = field(default_factory=dict)
    frf: dict[str, float] = field(default_factory=dict)
    frf_std: dict[str, float] = field(default_factory=dict)
    delays: dict[str, tuple[float, float]] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    misfit: dict[str, float] = field(default_factory=dict)
    responses: dict[str, FrequencyResponse] = field(default_factory=dict)
    fitted: dict[str, tuple[Floats, Complexes]] = field(default_factory=dict)
    loops: list[Loop] = field(default_factory=list)
    refined: dict[str, float] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)

    def unidentified(self) -> list[str]:
        """Keys without a value, or whose value is not known to within half of itself."""
        return [n for n in KEYS if not self._is_known(n)]

    def _is_known(self, name: str) -> bool:
        value, error = self.values.get(name, math.nan), self.std.get(name, math.nan)
        if not math.isfinite(value):
            return False
        if name == "J_z":
            return True  # held within 5 % of its known theoretical value
        if not math.isfinite(error):
            return False
        return name in SIGNED or error <= LARGEST_RELATIVE_ERROR * abs(value)


@dataclass
class Identification:
    """A campaign's result: per mode ("per-speed", "shared") the speeds ascending."""

    vehicle: KnownVehicle
    slip: str
    modes: dict[str, list[SpeedResult]]
    provenance: dict[str, object]

    def reference(self, mode: str) -> ReferenceFile | None:
        """The reference of one mode, or None where some key was identified at no speed at all.

        A key that was not identified at a speed is taken from the line through its two nearest identified speeds and
        listed in ``extrapolated``; so is one of FALLBACK where no speed told it.
        """
        results = self.modes[mode]
        known = {n: [r for r in results if n not in r.unidentified()] for n in KEYS}
        if not results or self.missing_keys(mode):
            return None
        rows, gaps = [], []
        for result in results:
            missing = tuple(n for n in KEYS if result not in known[n])
            filled = {
                n: _from_neighbours(result.speed_kmh, n, known[n]) if known[n] else FALLBACK[n] for n in missing
            }
            row = {n: filled.get(n, result.values.get(n, math.nan)) for n in KEYS}
            row["c_pin_off"] = min(row["c_pin_off"], row["c_pin_on"])
            rows.append(ReferenceRow(speed_kmh=result.speed_kmh, **row))
            gaps.append(missing)
        std = tuple(
            {n: r.std[n] for n in KEYS if n in r.std and n not in gap} for r, gap in zip(results, gaps, strict=True)
        )
        frf = tuple({n: v for n, v in r.frf.items() if n in KEYS} for r in results)
        return ReferenceFile(self.vehicle, tuple(rows), self.slip, std, frf, tuple(gaps), dict(self.provenance))

    def missing_keys(self, mode: str) -> list[str]:
        """Keys that no speed identified and that have no fallback: why there is no reference."""
        results = self.modes[mode]
        refined = any("refine" not in r.skipped for r in results)
        never = [n for n in KEYS if all(n in r.unidentified() for r in results)]
        return [n for n in never if n not in FALLBACK or not refined]


def _from_neighbours(speed_kmh: float, name: str, known: Sequence[SpeedResult]) -> float:
    """Value on the line through the two identified speeds nearest to ``speed_kmh``; at least a tenth of the nearest."""
    nearest = sorted(known, key=lambda r: abs(r.speed_kmh - speed_kmh))[:2]
    value = nearest[0].values[name]
    if len(nearest) == 2:
        a, b = nearest
        slope = (b.values[name] - a.values[name]) / (b.speed_kmh - a.speed_kmh)
        line = a.values[name] + slope * (speed_kmh - a.speed_kmh)
        # A straight line may cross zero where the parameter cannot.
        value = line if name in SIGNED and name != "k_gain" else max(line, 0.1 * value)
    return float(value)


def relative_errors(measured: Sequence[Floats], predicted: Sequence[Floats]) -> float:
    """Root mean square error over the root mean square of the measured signal."""
    error = np.concatenate([m - p for m, p in zip(measured, predicted, strict=True)])
    scale = np.concatenate(list(measured))
    return float(np.sqrt(np.mean(error**2) / np.mean(scale**2)))


def disagreement(a: SpeedResult, b: SpeedResult) -> Mapping[str, float]:
    """Difference of two modes in combined standard errors, by key that both identified."""
    found = {}
    for name in KEYS:
        if name in a.std and name in b.std and name in a.values and name in b.values:
            error = math.hypot(a.std[name], b.std[name])
            if error > 0.0 and math.isfinite(error):
                found[name] = (a.values[name] - b.values[name]) / error
    return found
