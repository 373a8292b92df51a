"""Where simulation and measurement disagree, before any effect is named.

Three looks at what the nominal model leaves over: how large it is against noise, by channel and frequency; whether
physical constants, refitted at each speed alone, drift with speed; and whether the residual follows something that was
measured: an angle, a rate, a torque, its sign or its size, or time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identification.frf import Floats
from identification.gap.evidence import residuals
from identification.gap.fit import Judge, stacked, weights_of
from identification.gap.search import LEAST_ERROR, Candidate

CONSTANTS = ("n_t", "C_f", "C_r", "J_z", "sigma_f", "sigma_r")  # cannot depend on speed
BLOCK_S = 2.0  # of the block bootstrap's blocks, longer than a residual stays coloured
STRONG = 3.0  # standard errors from which a symptom is listed
LEAST_SHARE = 0.03  # of a residual's energy that a feature must take to be listed
ZONE_NAMES = ("below 0.35 Hz", "from 0.35 to 2 Hz", "above 2 Hz")


class Symptom(NamedTuple):
    """One disagreement in words; ``where``: channel or parameter; ``strength``: standard errors or noise units."""

    what: str
    where: str
    strength: float


class Trace(NamedTuple):
    """Of one record, in time: measured and simulated output [n] of every channel, and the states [n]."""

    name: str
    measured: Mapping[str, Floats]
    simulated: Mapping[str, Floats]
    states: Mapping[str, Floats]
    keep: slice
    dt: float
    manoeuvre: str
    group: float


def symptoms(judge: Judge, null: Candidate, traces: Sequence[Trace]) -> list[Symptom]:
    """All symptoms of the fitted records, strongest first."""
    found = [*_sizes(judge, null), *drift(judge, null), *features(traces)]
    return sorted(found, key=lambda s: s.strength, reverse=True)


def _sizes(judge: Judge, null: Candidate) -> list[Symptom]:
    """Where the residual is larger than the noise."""
    left = residuals(judge, null.solution.predicted)
    found = []
    for row, name in enumerate(judge.names):
        there = [i for i, r in enumerate(left) if not np.isnan(r[row, 0])]
        error = sum(float(np.sum(left[i][row] ** 2)) for i in there)
        noise = sum(float(np.sum(judge.noise_power[i][row])) for i in there)
        ratio = float(np.sqrt(error / noise)) if noise > 0.0 else np.inf
        if ratio > 1.5:
            zone = ZONE_NAMES[int(np.argmax(null.error[row]))]
            what = f"the residual is {ratio:.1f} times the noise, most against the signal {zone}"
            found.append(Symptom(what, name, ratio))
    return found


def drift(judge: Judge, null: Candidate) -> list[Symptom]:
    """Physical constants that a fit at each speed alone would move apart."""
    groups = sorted({record.group for record in judge.records})
    names = [unknown.name for unknown in null.solution.unknowns]
    constants = [name for name in CONSTANTS if name in names]
    if len(groups) < 2 or not constants:
        return []
    weights = weights_of(judge, np.maximum(null.error, LEAST_ERROR))
    steps, errors = [], []
    for group in groups:
        inside = [i for i, record in enumerate(judge.records) if record.group == group]
        here = [weights[i] for i in inside]
        columns = [stacked([c[i] for i in inside], here) for c in null.solution.jacobian]
        left = stacked([judge.measured[i] - null.solution.predicted[i] for i in inside], here)
        prior = np.array([unknown.prior for unknown in null.solution.unknowns])
        body = np.column_stack(columns)
        inverse = np.linalg.pinv(body.T @ body + np.diag(1.0 / prior**2), hermitian=True)
        steps.append(inverse @ (body.T @ left))
        errors.append(np.sqrt(np.diag(inverse)))
    found = []
    for name in constants:
        k = names.index(name)
        moved, error = np.array([s[k] for s in steps]), np.array([e[k] for e in errors])
        mean = float(np.sum(moved / error**2) / np.sum(1.0 / error**2))
        strength = float(np.sqrt(np.mean(((moved - mean) / error) ** 2)))
        if strength > STRONG:
            slope = np.polyfit(groups, moved, 1)[0]
            way = "rises" if slope > 0.0 else "falls"
            changes = zip(100.0 * (np.exp(moved) - 1.0), groups, strict=True)
            sizes = ", ".join(f"{change:+.0f} % at {group:g}" for change, group in changes)
            found.append(Symptom(f"{name} {way} with speed if refitted at each ({sizes} km/h)", name, strength))
    return found


def generic(states: Mapping[str, Floats], dt: float) -> dict[str, Floats]:
    """Generic features [n] of measured states: size, sign, square, cube, and time."""
    found: dict[str, Floats] = {}
    n = 0
    for name, signal in states.items():
        scale = max(float(np.std(signal)), 1e-12)
        x = signal / scale
        n = x.size
        found[name] = x
        found[f"sign of the {name}"] = np.tanh(5.0 * x)
        found[f"size of the {name}"] = np.abs(x)
        found[f"cube of the {name}"] = x**3
    if n:
        found["time"] = np.linspace(-1.0, 1.0, n)
        found["nothing (a constant)"] = np.ones(n)
    return found


def features(traces: Sequence[Trace]) -> list[Symptom]:
    """Which feature each channel's residual follows most, with a block-wise standard error."""
    channels = list(dict.fromkeys(name for trace in traces for name in trace.measured))
    found = []
    for channel in channels:
        best: Symptom | None = None
        rows = [(t, t.measured[channel] - t.simulated[channel]) for t in traces if channel in t.measured]
        energy = sum(float(np.sum(r[t.keep] ** 2)) for t, r in rows)
        if energy <= 0.0:
            continue
        for name in generic(rows[0][0].states, rows[0][0].dt):
            along, size = [], []
            for trace, residual in rows:
                feature = generic(trace.states, trace.dt).get(name)
                if feature is None:
                    continue
                step = max(1, round(BLOCK_S / trace.dt))
                product, square = (residual * feature)[trace.keep], (feature**2)[trace.keep]
                cut = range(0, product.size, step)
                along += [float(product[k : k + step].sum()) for k in cut]
                size += [float(square[k : k + step].sum()) for k in cut]
            total, spread = float(np.sum(along)), float(np.std(along)) * np.sqrt(len(along))
            share = total**2 / max(float(np.sum(size)), 1e-300) / energy
            strength = abs(total) / spread if spread > 0.0 else 0.0
            if share > LEAST_SHARE and strength > STRONG and (best is None or strength > best.strength):
                best = Symptom(f"the residual follows {name} ({100.0 * share:.0f} % of its energy)", channel, strength)
        if best is not None:
            found.append(best)
    return found
