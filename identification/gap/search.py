"""Which effects could be missing: screened by what the nominal parameters cannot absorb, then refitted jointly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identification.frf import Floats
from identification.gap.basis import ZONES_HZ
from identification.gap.covariance import clustered_covariance
from identification.gap.evidence import error_of, likelihoods
from identification.gap.fit import (
    FINE,
    Columns,
    Judge,
    Solution,
    body_of,
    effect_unknowns,
    fit,
    stacked,
    weights_of,
)
from steer_env.physics.effects import Effect

FIRST_ERRORS = (0.03, 0.005)  # relative model errors with which a nominal fit begins
LEAST_ERROR = 0.002  # relative model error that is always allowed for: no fit is held to the last noise bit
PASSES, ENOUGH = 6, 2.0  # refits until the log-likelihood gains less than this
FEW = 8  # nominal unknowns up to which every candidate is searched from where they are believed, too
MANY = 8  # probes from which on an effect is scanned on a few records first


class Candidate(NamedTuple):
    """Effects refitted jointly with the nominal unknowns, and how they do on fitted and held-out records.

    ``error``: relative model error [channels, zones] that is left on the fitted records; ``fitted`` and ``held``:
    log-likelihoods [blocks] with it.
    """

    names: tuple[str, ...]
    solution: Solution
    error: Floats
    fitted: Floats
    held: Floats
    held_prediction: list[Floats]

    @property
    def parameters(self) -> int:
        """Number of parameters of the effects."""
        return sum("." in unknown.name for unknown in self.solution.unknowns)


class Screened(NamedTuple):
    """An effect's best probe, the share of the residual's energy that its direction takes, and what that gains.

    ``gain`` is the log-likelihood that a small amplitude in the probe's direction would add.
    """

    effect: Effect
    probe: Mapping[str, float]
    score: float
    gain: float
    direction: list[Floats]  # change of the prediction that the probe makes, per record


def judged_candidate(names: tuple[str, ...], solution: Solution, judge: Judge, held: Judge) -> Candidate:
    """A solution with its evidence, its covariance as the residual really scatters."""
    error = error_of(judge, solution.predicted)
    solution = solution._replace(covariance=clustered_covariance(judge, solution, np.maximum(error, LEAST_ERROR)))
    prediction = held.predict(solution.values)
    return Candidate(
        names,
        solution,
        error,
        likelihoods(judge, solution.predicted, error),
        likelihoods(held, prediction, error),
        prediction,
    )


def settled(judge: Judge, held: Judge, base: Candidate) -> Candidate:
    """A candidate refitted until the model error that weighs the fit is the one that the fit leaves."""
    for _ in range(PASSES):
        error = np.maximum(base.error, LEAST_ERROR)
        known = base.solution.jacobian
        solution = fit(judge, base.solution.unknowns, error, base.solution.values, FINE, known)
        found = judged_candidate(base.names, solution, judge, held)
        gained = float(found.fitted.sum() - base.fitted.sum())
        base = found if gained > 0.0 else base
        if gained < ENOUGH:
            break
    return base


def null_fit(judge: Judge, held: Judge) -> Candidate:
    """The nominal model alone, its allowed model error found along the way.

    A zone that one fit leaves badly is given up by the next, which then never mends it; so the search starts from more
    than one idea of the model error and keeps the likeliest end.
    """
    ends = []
    for first in FIRST_ERRORS:
        solution = fit(judge, judge.model.unknowns, np.full((len(judge.names), len(ZONES_HZ) + 1), first))
        ends.append(settled(judge, held, judged_candidate((), solution, judge, held)))
    return max(ends, key=lambda c: float(c.fitted.sum()))


def screen(judge: Judge, base: Candidate, effects: Mapping[str, Effect], error: Floats) -> list[Screened]:
    """Every effect by its best probe, best first.

    A probe's change of the prediction is projected orthogonally to what the parameters already fitted can do; its
    correlation with the residual is the score, a share of the residual's weighted energy.
    """
    weights = weights_of(judge, error)
    left = stacked([m - p for m, p in zip(judge.measured, base.solution.predicted, strict=True)], weights)
    basis, _ = np.linalg.qr(body_of(base.solution.jacobian, weights))
    left = left - basis @ (basis.T @ left)
    energy = float(left @ left)
    found = []
    for effect in effects.values():
        probes = list(effect.probes)
        if len(probes) > MANY:
            probes = _scanned(judge, base, effect, weights)
        changes = _directions(judge, base, effect, probes)
        best = Screened(effect, probes[0], -1.0, 0.0, [])
        for probe, change in zip(probes, changes, strict=True):
            direction = stacked(change, weights)
            size = float(direction @ direction)
            direction = direction - basis @ (basis.T @ direction)
            rest = float(direction @ direction)
            if rest <= 1e-9 * size or size == 0.0:
                continue
            along = float(direction @ left)
            score = along * abs(along) / rest / energy if _one_sided(effect) else along * along / rest / energy
            if score > best.score:
                best = Screened(effect, probe, score, 0.5 * score * energy, [c for c in change if c is not None])
        if best.direction:
            found.append(best)
    return sorted(found, key=lambda s: s.score, reverse=True)


def _one_sided(effect: Effect) -> bool:
    plausible = effect.plausible.get(effect.amplitude)
    absent = float(getattr(effect.absent(), effect.amplitude))
    return plausible is not None and not plausible.signed and plausible.low > absent


def _directions(
    judge: Judge, base: Candidate, effect: Effect, probes: Sequence[Mapping[str, float]], only: Sequence[int] = ()
) -> list[Columns]:
    """Change of the prediction that each probe makes, per record; None outside ``only``."""
    many = []
    for probe in probes:
        full = effect.at(probe)._asdict()
        many.append({**base.solution.values, **{f"{effect.name}.{name}": value for name, value in full.items()}})
    wanted = list(only) or list(range(len(judge.records)))
    predicted = judge.predictions(many, [wanted] * len(many))
    return [
        [None if p is None else p - b for p, b in zip(row, base.solution.predicted, strict=True)] for row in predicted
    ]


def _scanned(judge: Judge, base: Candidate, effect: Effect, weights: Sequence[Floats]) -> list[Mapping[str, float]]:
    """The best few of many probes, judged on slow records of one speed alone."""
    slow = [i for i, r in enumerate(judge.records) if r.manoeuvre != "frequency_response"] or [0]
    groups = sorted({judge.records[i].group for i in slow})
    only = [i for i in slow if judge.records[i].group == groups[len(groups) // 2]]
    changes = _directions(judge, base, effect, effect.probes, only)
    predicted = base.solution.predicted
    rows = enumerate(zip(judge.measured, predicted, strict=True))
    left = stacked([m - p if i in only else None for i, (m, p) in rows], weights)
    scores = []
    for change in changes:
        direction = stacked([c if i in only else None for i, c in enumerate(change)], weights)
        size = float(direction @ direction)
        scores.append(float(direction @ left) ** 2 / size if size > 0.0 else 0.0)
    return [effect.probes[k] for k in np.argsort(scores)[::-1][:MANY]]


def refit(judge: Judge, held: Judge, base: Candidate, chosen: Screened, error: Floats) -> Candidate:
    """The effect's parameters and all that ``base`` has, fitted together (``settled`` finishes what leads).

    With few nominal unknowns it costs little to search from where these are believed as well, as ``null_fit`` does:
    an effect that is large beside the nominal torque bends them so far that no way leads back.
    """
    more, start = effect_unknowns(chosen.effect, chosen.probe)
    unknowns, names = (*base.solution.unknowns, *more), (*base.names, chosen.effect.name)
    from_base = {**base.solution.values, **start}
    solution = fit(judge, unknowns, error, from_base, FINE, base.solution.jacobian, renew=False)
    ends = [judged_candidate(names, solution, judge, held)]
    if len(judge.model.unknowns) <= FEW:
        believed = {**from_base, **{unknown.name: unknown.start for unknown in judge.model.unknowns}}
        solution = fit(judge, unknowns, np.full_like(error, FIRST_ERRORS[0]), believed)
        ends.append(judged_candidate(names, solution, judge, held))
        return settled(judge, held, max(ends, key=lambda c: float(c.fitted.sum())))
    return ends[0]


def unbent(judge: Judge, held: Judge, effect: Effect, probe: Mapping[str, float], error: Floats) -> Candidate:
    """The effect beside the nominal unknowns, searched from where these are believed and from a probe."""
    more, start = effect_unknowns(effect, probe)
    solution = fit(judge, (*judge.model.unknowns, *more), error, start)
    return judged_candidate((effect.name,), solution, judge, held)
