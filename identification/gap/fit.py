"""Least squares over all records and channels at once: nominal unknowns, with or without effects.

Everything happens on cosine coefficients (``basis``): a prediction is a list of arrays [channels, k], one per record,
and a Jacobian one such list per parameter. Weights change without simulating anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from identification.frf import Floats
from identification.gap.basis import Band, NoiseSpectrum, band_of, error_zone, spread_power
from identification.gap.model import Model, Record, Unknown
from steer_env.physics.effects import Effect
from steer_env.units import quantities

ROUGH, FINE = 30, 8  # largest numbers of steps of a first fit and of a refit
ENOUGH = 0.5  # of twice the log-likelihood: a step that gains less ends a fit
SHAPE_PRIOR = 1.0  # of the logarithm of a shape parameter that has no plausible range
FAR = 5.0  # prior of an amplitude: this many times the largest plausible one, only to keep singular fits still
Columns = list[Floats | None]


class Solution(NamedTuple):
    """Fitted parameters by name, their covariance on the search scale, and what they predict."""

    unknowns: tuple[Unknown, ...]
    x: Floats
    covariance: Floats
    predicted: list[Floats]
    jacobian: list[Columns]

    @property
    def values(self) -> dict[str, float]:
        """Parameter values in their units."""
        return {u.name: float(np.exp(v) if u.log else v) for u, v in zip(self.unknowns, self.x, strict=True)}

    def interval(self, name: str, widened: float = 1.0) -> tuple[float, float]:
        """95 % interval of a parameter in its unit, ``widened`` by a factor on the search scale."""
        k = [u.name for u in self.unknowns].index(name)
        half = 1.96 * widened * float(np.sqrt(self.covariance[k, k]))
        low, high = float(self.x[k]) - half, float(self.x[k]) + half
        return (float(np.exp(low)), float(np.exp(high))) if self.unknowns[k].log else (low, high)


def effect_unknowns(effect: Effect, probe: Mapping[str, float]) -> tuple[tuple[Unknown, ...], dict[str, float]]:
    """The parameters of an effect as unknowns named "effect.parameter", and the probe as values to search from.

    Amplitudes are believed near "absent", so weakly that only a singular fit would notice; shapes in the middle of
    their plausible range, half of which is a standard deviation.
    """
    found, start = [], {}
    for name, quantity in quantities(effect.parameters).items():
        value = float(getattr(effect.at(probe), name))
        plausible = effect.plausible.get(name)
        shape = name != effect.amplitude and value > 0.0
        log = shape and (plausible is None or (plausible.low > 0.0 and not plausible.signed))
        size = max(abs(plausible.low), abs(plausible.high)) if plausible is not None else abs(value)
        absent = float(getattr(effect.absent(), name))
        near = absent if name == effect.amplitude and abs(absent) < FAR * size else value
        label = f"{effect.name}.{name}"
        prior = FAR * max(size, 1e-12)
        if log:
            prior = SHAPE_PRIOR
            if plausible is not None:
                near = float(np.sqrt(plausible.low * plausible.high))
                prior = 0.1 + 0.5 * float(np.log(plausible.high / plausible.low))
        least = max(quantity.low, 1e-6 * near) if log else quantity.low
        found.append(Unknown(label, near, least, quantity.high, prior, log))
        start[label] = value
    return tuple(found), start


def present_of(values: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Effects that are on, from values by "effect.parameter"."""
    present: dict[str, dict[str, float]] = {}
    for name, value in values.items():
        effect, dot, parameter = name.partition(".")
        if dot:
            present.setdefault(effect, {})[parameter] = value
    return present


@dataclass
class Judge:
    """The records of one role in cosine coefficients; a model error is [channels, zones] everywhere."""

    model: Model
    records: Sequence[Record]
    noise: NoiseSpectrum
    names: Sequence[str]
    jobs: int = 1
    bands: list[Band] = field(init=False)
    measured: list[Floats] = field(init=False)
    noise_power: list[Floats] = field(init=False)
    signal_power: list[Floats] = field(init=False)

    def __post_init__(self) -> None:
        self.bands = [band_of(record, self.model.band_Hz) for record in self.records]
        self.measured = [
            band.of(self.model.judged(record.outputs), self.names)
            for record, band in zip(self.records, self.bands, strict=True)
        ]
        self.noise_power = [self.noise.at(r, b.frequency) for r, b in zip(self.records, self.bands, strict=True)]
        self.signal_power = [spread_power(m, b.frequency) for m, b in zip(self.measured, self.bands, strict=True)]

    def predict(self, values: Mapping[str, float]) -> list[Floats]:
        """Predicted coefficients [channels, k] of each record."""
        everything = range(len(self.records))
        return [part for part in self.predictions([values], [everything])[0] if part is not None]

    def predictions(self, many: Sequence[Mapping[str, float]], wanted: Sequence[Sequence[int]]) -> list[Columns]:
        """For each set of values the predictions of the records wanted, None for the others."""
        tasks = [(k, i) for k in range(len(many)) for i in wanted[k]]
        presents = [present_of(values) for values in many]

        def one(task: tuple[int, int]) -> Floats:
            k, i = task
            outputs = self.model.simulate(self.records[i], many[k], presents[k])
            return self.bands[i].of(self.model.judged(outputs), self.names)

        if self.jobs > 1 and len(tasks) > 1:
            with ThreadPoolExecutor(max_workers=self.jobs) as pool:
                done = list(pool.map(one, tasks))
        else:
            done = [one(task) for task in tasks]
        result: list[Columns] = [[None] * len(self.records) for _ in many]
        for (k, i), coefficients in zip(tasks, done, strict=True):
            result[k][i] = coefficients
        return result

    def variance(self, error: Floats) -> list[Floats]:
        """Power [channels, k] that a residual may have: noise, and model errors of relative size ``error``."""
        parts = zip(self.noise_power, self.signal_power, self.bands, strict=True)
        return [self.allowed(noise, signal, band, error) for noise, signal, band in parts]

    @staticmethod
    def allowed(noise: Floats, signal: Floats, band: Band, error: Floats) -> Floats:
        """Power [channels, k] of noise and model error together, for one record."""
        power: Floats = noise + error[:, error_zone(band.frequency)] ** 2 * signal
        return power

    def columns(
        self, unknowns: Sequence[Unknown], x: Floats, base: Sequence[Floats], steps: Floats, which: Sequence[int]
    ) -> list[Columns]:
        """Finite-difference Jacobian on the search scale: per unknown in ``which``, per record [channels, k]."""
        many, wanted = [], []
        for k in which:
            many.append(_values(unknowns, np.where(np.arange(x.size) == k, x + steps, x)))
            wanted.append([i for i, r in enumerate(self.records) if unknowns[k].group in (None, r.group)])
        return [
            [None if p is None else (p - b) / steps[k] for p, b in zip(row, base, strict=True)]
            for row, k in zip(self.predictions(many, wanted), which, strict=True)
        ]


def _values(unknowns: Sequence[Unknown], x: Floats) -> dict[str, float]:
    return {u.name: float(np.exp(v) if u.log else v) for u, v in zip(unknowns, x, strict=True)}


def weights_of(judge: Judge, error: Floats) -> list[Floats]:
    """One over the standard deviation [channels, k] that a residual may have, per record."""
    return [1.0 / np.sqrt(v) for v in judge.variance(error)]


def body_of(columns: Sequence[Columns], weights: Sequence[Floats]) -> Floats:
    """The weighted Jacobian [coefficients, unknowns]; a probe that goes off says nothing."""
    body = np.column_stack([stacked(column, weights) for column in columns])
    return np.nan_to_num(body, copy=False, posinf=0.0, neginf=0.0)


def stacked(parts: Sequence[Floats | None], weights: Sequence[Floats]) -> Floats:
    """One weighted vector of all coefficients that are measured; zeros for a record that is None."""
    flat = []
    for part, weight in zip(parts, weights, strict=True):
        there = ~np.isnan(weight)
        flat.append(np.zeros(int(there.sum())) if part is None else (part * weight)[there])
    return np.concatenate(flat)


def fit(
    judge: Judge, unknowns: Sequence[Unknown], error: Floats, start: Mapping[str, float] | None = None,
    steps: int = ROUGH, known: Sequence[Columns] = (), renew: bool = True,
) -> Solution:  # fmt: skip
    """Fit unknowns from ``start`` (by name; else from where they are believed), by damped Gauss-Newton steps.

    ``error`` [channels, zones] is the relative model error that ``Judge.variance`` allows for. ``known`` are columns
    of the Jacobian from a fit nearby, for the first unknowns: they serve until a step disappoints; with ``renew`` they
    are then made anew and the fit goes on.
    """
    search = _Descent(judge, unknowns, error, start or {}, known)
    for _ in range(steps):
        gained = search.step()
        if gained > ENOUGH:
            continue
        if search.stale and renew:
            search.renew()
        else:
            break
    return search.solution()


class _Descent:
    """The state of one fit: where it stands, what that predicts, and how the prediction changes."""

    def __init__(
        self, judge: Judge, unknowns: Sequence[Unknown], error: Floats, start: Mapping[str, float],
        known: Sequence[Columns],
    ) -> None:  # fmt: skip
        self.judge, self.unknowns = judge, tuple(unknowns)
        self.weights = weights_of(judge, error)
        self.scale = np.array([u.prior for u in unknowns])
        self.low, self.high = (np.array([_searched(u, getattr(u, side)) for u in unknowns]) for side in ("low", "high"))
        self.believed = np.array([_searched(u, u.start) for u in unknowns])
        first = np.array([_searched(u, start.get(u.name, u.start)) for u in unknowns])
        self.x = np.clip(first, self.low, self.high)
        self.size = np.array([_step(u, v, f) for u, v, f in zip(unknowns, self.x, first, strict=True)])
        self.predicted = judge.predict(_values(self.unknowns, self.x))
        self.cost = self._cost(self.x, self.predicted)
        self.damping = 1e-4
        self.columns: list[Columns] = list(known)
        self.stale = len(known)  # so many of the first columns come from elsewhere
        self.columns += self._columns(range(len(known), len(self.unknowns)))

    def step(self) -> float:
        """One step downhill; returns what the cost lost by it, zero where no step helps."""
        body = body_of(self.columns, self.weights)
        left = stacked([m - p for m, p in zip(self.judge.measured, self.predicted, strict=True)], self.weights)
        prior = 1.0 / self.scale**2
        gradient = body.T @ left - prior * (self.x - self.believed)
        normal = body.T @ body + np.diag(prior)
        stuck = ((self.x <= self.low) & (gradient < 0.0)) | ((self.x >= self.high) & (gradient > 0.0))
        free = np.flatnonzero(~stuck)
        for _ in range(6):
            damped = normal[np.ix_(free, free)] + self.damping * np.diag(np.diag(normal)[free])
            x = self.x.copy()
            x[free] += np.linalg.pinv(damped, hermitian=True) @ gradient[free]
            x = np.clip(np.where(np.isfinite(x), x, self.x), self.low, self.high)
            predicted = self.judge.predict(_values(self.unknowns, x))
            cost = self._cost(x, predicted)
            if cost < self.cost:
                gained, self.cost, self.x, self.predicted = self.cost - cost, cost, x, predicted
                self.damping = max(1e-8, 0.1 * self.damping)
                self.columns[self.stale :] = self._columns(range(self.stale, len(self.unknowns)))
                return gained
            self.damping = max(1e-3, 10.0 * self.damping)
        return 0.0

    def renew(self) -> None:
        """Make the columns that came from elsewhere anew."""
        self.columns[: self.stale] = self._columns(range(self.stale))
        self.stale, self.damping = 0, 1e-4

    def solution(self) -> Solution:
        """Where the search ended."""
        body = body_of(self.columns, self.weights)
        covariance = np.linalg.pinv(body.T @ body + np.diag(1.0 / self.scale**2), hermitian=True)
        return Solution(self.unknowns, self.x, covariance, self.predicted, self.columns)

    def _cost(self, x: Floats, predicted: Sequence[Floats]) -> float:
        left = stacked([m - p for m, p in zip(self.judge.measured, predicted, strict=True)], self.weights)
        misfit = float(left @ left)
        if not np.isfinite(misfit):  # the simulation went off: no place to stay
            return np.inf
        return misfit + float(np.sum(((x - self.believed) / self.scale) ** 2))

    def _columns(self, which: Sequence[int]) -> list[Columns]:
        signed = np.where(self.x + self.size > self.high, -self.size, self.size)
        return self.judge.columns(self.unknowns, self.x, self.predicted, signed, which)


def _searched(unknown: Unknown, value: float) -> float:
    """A value on the search scale."""
    return float(np.log(value)) if unknown.log else value


def _step(unknown: Unknown, x: float, first: float) -> float:
    """Finite-difference step on the search scale: small against what matters, large against rounding."""
    if unknown.log:
        return 0.02
    return 0.05 * max(abs(x), 0.2 * abs(first), 1e-9) if "." in unknown.name else 0.05 * unknown.prior
