"""Stagewise bounded least squares, and standard errors that carry an early stage's error into the later ones.

The paper fits in steps: C_f and C_r first, then J_z with them held, and so on. Each step's estimate solves
J' r = 0 for its own unknowns, so all steps together are one set of estimating equations, and their sandwich
covariance G^-1 S G^-T holds for the chain as a whole: G is the (block lower triangular) derivative of all equations,
S the scatter of the scores. Scores are summed within clusters first (one run at one frequency, over all channels;
or one block of time), so errors may be coloured, of unequal size, and correlated between channels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.optimize import least_squares

from identification.frf import Complexes, Floats, FrequencyResponse

Values = Mapping[str, float]
Scores = dict[tuple[object, ...], Floats]
Model = Callable[[Values, FrequencyResponse], Complexes]

BANDS_PER_OCTAVE = 1.0  # errors of a model are taken as independent between bands of this width, not within


class Problem(Protocol):
    """Residuals to be made small, and how they scatter; ``uses`` says which parameters they depend on."""

    def uses(self, name: str) -> bool:
        """Whether the residual depends on a parameter (False saves work, never changes a result)."""

    def residual(self, values: Values) -> Floats:
        """Residuals [m] at the parameter values."""

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """Random part of J' r by cluster: key -> [n_parameters]; ``jacobian`` is [m, n_parameters]."""


@dataclass(frozen=True)
class ResponseTerm:
    """One measured FRF against a model in magnitude and phase (Eqs. 7, 8 and 11).

    Magnitude errors are divided by the static gain, phase errors by pi, both inside the square; weights multiply the
    mean squares. ``model`` gives H [n, 3] at the response's lines; ``key`` names the recording of the clusters.
    """

    response: FrequencyResponse
    model: Model
    key: object
    magnitude_weight: float = 1.0
    phase_weight: float = 1.0

    def uses(self, name: str) -> bool:
        """A model is cheap enough to be asked about everything."""
        return True

    def residual(self, values: Values) -> Floats:
        """[2 n]: magnitude, then phase."""
        H = self.response.average(self.model(values, self.response))
        magnitude = np.abs(H) - self.response.magnitude
        phase = np.angle(H / self.response.value)
        scale_m, scale_p = self._scales()
        return np.concatenate([magnitude * scale_m, phase * scale_p])

    def scores(self, jacobian: Floats, values: Values) -> Scores:
        """One cluster per run and frequency point, the same for every channel of a recording."""
        scale_m, scale_p = self._scales()
        relative = self.response.deviation / self.response.value
        magnitude = -relative.real * self.response.magnitude * scale_m
        random = _scores_of(self.response, self.key, magnitude, -relative.imag * scale_p, jacobian)
        return random | self._systematic(jacobian, values)

    def _systematic(self, jacobian: Floats, values: Values) -> Scores:
        """What the model leaves out: the mean residual's scores, one cluster per band, shared by all channels."""
        error, n = self.residual(values), self.response.value.size
        found: Scores = {}
        for k, frequency in enumerate(self.response.frequency):
            key = (self.key, "model", round(BANDS_PER_OCTAVE * float(np.log2(frequency))))
            score = jacobian[k] * error[k] + jacobian[n + k] * error[n + k]
            found[key] = found[key] + score if key in found else score
        return found

    def _scales(self) -> tuple[float, float]:
        n = max(self.response.value.size, 1)
        return (
            np.sqrt(self.magnitude_weight / n) / self.response.static_gain,
            np.sqrt(self.phase_weight / n) / np.pi,
        )


def _scores_of(response: FrequencyResponse, key: object, first: Floats, second: Floats, jacobian: Floats) -> Scores:
    """Scores by (key, run, point) from the two halves [n_clusters, n] of the residual's deviation."""
    count, n = first.shape
    inflate = np.sqrt(count / (count - 1.0))
    return {
        (key, run, int(response.point[k])): inflate * (first[run, k] * jacobian[k] + second[run, k] * jacobian[n + k])
        for run in range(count)
        for k in range(n)
    }


@dataclass
class Chain:
    """Parameters found so far, by stage, with what their joint covariance needs.

    ``values`` holds the newest value of each name; ``fixed`` what is known; ``at_bound`` the names that ended on a
    bound (they have no standard error); ``covariance()`` and ``std_`` follow from all stages run on this chain.
    """

    values: dict[str, float]
    at_bound: set[str] = field(default_factory=set)
    _order: list[tuple[int, str]] = field(default_factory=list)
    _rows: list[dict[tuple[int, str], Floats]] = field(default_factory=list)
    _scores: list[Scores] = field(default_factory=list)
    _newest: dict[str, tuple[int, str]] = field(default_factory=dict)
    _members: list[list[tuple[int, str]]] = field(default_factory=list)

    def copy(self) -> Chain:
        """A chain that continues from here on its own."""
        return Chain(
            dict(self.values), set(self.at_bound), list(self._order), list(self._rows), list(self._scores),
            dict(self._newest), list(self._members),
        )  # fmt: skip

    def fit(
        self,
        problems: Sequence[Problem],
        start: Values,
        bounds: Mapping[str, tuple[float, float]],
        tolerance: float = 1e-10,
        final: bool = True,
    ) -> Chain:
        """Fit the names in ``start`` within ``bounds`` with everything else held; returns self.

        ``tolerance`` is the relative change of cost and parameters that ends the search. A fit that is not ``final``
        only moves the values: a later one of the same names must follow, which alone enters the errors.
        """
        names = list(start)
        lower, upper = np.array([bounds[n] for n in names], dtype=float).T
        scale = np.maximum(np.abs([start[n] for n in names]), 1e-3 * (upper - lower))

        def residual(x: Floats) -> Floats:
            at = {**self.values, **dict(zip(names, x * scale, strict=True))}
            return np.concatenate([p.residual(at) for p in problems])

        inside = np.clip(list(start.values()), lower + 1e-6 * (upper - lower), upper - 1e-6 * (upper - lower))
        found = least_squares(
            residual, inside / scale, bounds=(lower / scale, upper / scale), xtol=tolerance, ftol=tolerance, gtol=1e-14
        )
        x = found.x * scale
        self.values.update(zip(names, map(float, x), strict=True))
        margin = 1e-4 * (upper - lower)
        stuck = {n for n, v, lo, hi, m in zip(names, x, lower, upper, margin, strict=True) if not lo + m < v < hi - m}
        self.at_bound = (self.at_bound - set(names)) | stuck
        if final:
            self._record(problems, [n for n in names if n not in stuck])
        return self

    def _record(self, problems: Sequence[Problem], free: list[str]) -> None:
        """Keep this stage's derivative with respect to every parameter so far, and its scores."""
        stage = len(self._members)
        members = [(stage, name) for name in free]
        for name in free:
            self._newest[name] = (stage, name)
        self._order += members
        self._members.append(members)
        jacobians = [self._jacobian(p) for p in problems]
        own = [np.column_stack([J[name] for name in free]) if free else np.zeros((0, 0)) for J in jacobians]
        row: dict[tuple[int, str], Floats] = {}
        scores: Scores = {}
        if free:
            for name, identity in self._newest.items():
                row[identity] = sum(
                    (Jo.T @ J[name] for Jo, J in zip(own, jacobians, strict=True)), np.zeros(len(free))
                )
            for problem, Jo in zip(problems, own, strict=True):
                for key, score in problem.scores(Jo, self.values).items():
                    scores[key] = scores[key] + score if key in scores else score
        self._rows.append(row)
        self._scores.append(scores)

    def _jacobian(self, problem: Problem) -> dict[str, Floats]:
        """Central differences of the residual for every parameter found so far."""
        columns = {}
        nothing = np.zeros_like(problem.residual(self.values))
        for name in self._newest:
            if not problem.uses(name):
                columns[name] = nothing
                continue
            step = 1e-5 * max(abs(self.values[name]), 1e-3)
            up = problem.residual({**self.values, name: self.values[name] + step})
            down = problem.residual({**self.values, name: self.values[name] - step})
            columns[name] = (up - down) / (2.0 * step)
        return columns

    def covariance(self) -> tuple[list[str], Floats]:
        """Names and the covariance [n, n] of their newest values."""
        place = {identity: k for k, identity in enumerate(self._order)}
        n = len(place)
        G, S = np.zeros((n, n)), np.zeros((n, n))
        clusters: Scores = {}
        for members, row, scores in zip(self._members, self._rows, self._scores, strict=True):
            mine = [place[m] for m in members]
            for identity, derivative in row.items():
                G[mine, place[identity]] = derivative
            for key, score in scores.items():
                clusters.setdefault(key, np.zeros(n))[mine] += score
        for score in clusters.values():
            S += np.outer(score, score)
        size: Floats = np.array([max(abs(self.values[name]), 1e-3) for _, name in self._order])
        # Every equation is multiplied by its parameter's size, every column too: units then cannot spoil the inverse.
        inverse = np.linalg.pinv(G * np.outer(size, size), rcond=1e-13) * np.outer(size, size)
        full = inverse @ S @ inverse.T
        newest = [place[i] for i in self._newest.values()]
        return list(self._newest), full[np.ix_(newest, newest)]

    def error_of(self, function: Callable[[Values], float]) -> float:
        """Standard error of a number that follows from the values (delta method)."""
        names, covariance = self.covariance()
        gradient = np.zeros(len(names))
        for k, name in enumerate(names):
            step = 1e-4 * max(abs(self.values[name]), 1e-3)
            up = function({**self.values, name: self.values[name] + step})
            gradient[k] = (up - function({**self.values, name: self.values[name] - step})) / (2.0 * step)
        return float(np.sqrt(max(float(gradient @ covariance @ gradient), 0.0)))

    @property
    def std_(self) -> dict[str, float]:
        """Standard error by name; names at a bound have none."""
        names, covariance = self.covariance()
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return {n: float(e) for n, e in zip(names, errors, strict=True) if n not in self.at_bound}
