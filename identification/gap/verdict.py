"""The verdict: one effect, two, none that matters, or something that the catalogue does not know.

An effect is named if held-out records confirm it: the likelihood grows in block after block, what it changes it puts
right, and its amplitude lies where the name makes sense. Honest model error passes none of the three: it makes small
gains in many places and puts little of any of them right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from identification.gap.evidence import fidelity, normalised
from identification.gap.fit import Judge
from identification.gap.search import LEAST_ERROR, Candidate, Screened, null_fit, refit, screen, settled, unbent
from steer_env.physics.effects import Effect

NEARLY = 0.1  # share left wrong that is as good as none
ALIKE = 0.05  # difference in the share put right that says nothing


class Rules(NamedTuple):
    """Limits of the verdict; chosen on the tuning seeds of ``experiments.gap_study``, which reports on other seeds."""

    refitted: int = 8  # candidates that are refitted jointly, by screening score,
    promising: float = 0.05  # of those that gain this share of the best one's gain
    least_gain: float = 8.0  # and so much log-likelihood
    least_bic: float = 10.0
    least_z: float = 2.0  # of the held-out gain over its scatter between blocks
    least_fidelity: float = 0.6
    sure: float = 0.8  # fidelity from which effects that the nominal fit may have bent around are not tried
    range_slack: float = 0.5  # relative width around the plausible range in which a name is still believed
    second_fidelity: float = 0.65
    second_z: float = 3.0
    equal: float = 0.6  # an accepted rival with this share of the best one's strength could be it


# A driver's torque holds what the road does to the wheel, which no angle explains: less can be put right.
RULES = {
    "vehicle": Rules(),
    "rig": Rules(),
    "drive": Rules(least_fidelity=0.2, second_fidelity=0.2, second_z=2.0),
}


class Judged(NamedTuple):
    """A candidate against the one that it extends, by the measures that the rules are about."""

    candidate: Candidate
    screened: Screened
    delta_bic: float
    held_gain: float
    z: float
    fidelity: float
    in_range: bool
    gap_after: float  # held-out residual over the signal, root mean square over judged channels

    @property
    def name(self) -> str:
        """Name of the effect that was added."""
        return self.candidate.names[-1]

    @property
    def strength(self) -> float:
        """What candidates are ranked by: held-out gain over its scatter, over the share that is left wrong.

        The likelihood itself would favour what makes small gains everywhere, as honest model error lets many do.
        """
        return self.z / (NEARLY + 1.0 - min(max(self.fidelity, 0.0), 1.0))

    def accepted(self, rules: Rules, second: bool = False) -> bool:
        """Whether the rules let the added effect be named."""
        return (
            self.in_range
            and self.delta_bic > rules.least_bic
            and self.z > (rules.second_z if second else rules.least_z)
            and self.fidelity > (rules.second_fidelity if second else rules.least_fidelity)
        )


class Search(NamedTuple):
    """Everything that was tried: the null model, singles, and what was added to the best single."""

    null: Candidate
    singles: list[Judged]
    pairs: list[Judged]
    best: Candidate  # null, single or pair that the rules accept


def judged(judge: Judge, held: Judge, base: Candidate, found: Candidate, screened: Screened, rules: Rules) -> Judged:
    """Measure a candidate against what it extends."""
    gain = float(found.fitted.sum() - base.fitted.sum())
    size = sum(int(np.count_nonzero(~np.isnan(m))) for m in judge.measured)
    more = found.parameters - base.parameters
    steps = found.held - base.held
    spread = float(np.std(steps)) * np.sqrt(steps.size)
    return Judged(
        found,
        screened,
        2.0 * gain - more * float(np.log(size)),
        float(steps.sum()),
        float(steps.sum()) / spread if spread > 0.0 else 0.0,
        fidelity(held, base.held_prediction, found.held_prediction, found.error),
        in_range(found, screened.effect, rules.range_slack),
        float(np.sqrt(np.mean([error**2 for error, _ in normalised(held, found.held_prediction).values()]))),
    )


def in_range(found: Candidate, effect: Effect, slack: float, reaching: bool = True) -> bool:
    """Whether the fitted parameters of an effect lie in their plausible ranges, widened by ``slack``.

    A parameter whose 95 % interval reaches into its range does: where two of them can hardly be told apart, that is no
    evidence against the name. Without ``reaching`` the values themselves must lie there.
    """
    values = found.solution.values
    if effect.size is not None:
        fitted = effect.at({n: values[f"{effect.name}.{n}"] for n in effect.parameters._fields})
        if effect.size(fitted) < effect.least_size * (1.0 - slack):
            return False
    for name, plausible in effect.plausible.items():
        label = f"{effect.name}.{name}"
        low, high = found.solution.interval(label)
        value = values[label]
        reaches = low <= plausible.high and high >= plausible.low and not plausible.signed
        reaches = reaches or plausible.holds(low) or plausible.holds(high)
        if not (plausible.holds(value, slack) or (reaching and reaches)):
            return False
    return True


def search(
    judge: Judge, held: Judge, effects: Mapping[str, Effect], rules: Rules, advance: Callable[..., None]
) -> Search:
    """Try every effect alone, then, beside the best accepted one, every other as a second."""
    null = null_fit(judge, held)
    advance(note="nominal model")
    singles = _tried(judge, held, null, effects, rules, advance)
    first = _leader([s for s in singles if s.accepted(rules)])
    if first is None or first.fidelity < rules.sure:
        singles = _with_unbent(judge, held, null, singles, effects, rules)
        first = _leader([s for s in singles if s.accepted(rules)])
    sole = first is not None
    if first is None:  # two effects can hide each other: neither puts much right without the other
        promising = [s for s in singles if s.in_range and s.z > rules.least_z and s.delta_bic > rules.least_bic]
        if not promising:
            return Search(null, singles, [], null)
        first = max(promising, key=lambda j: j.delta_bic)
    others = {name: effect for name, effect in effects.items() if name != first.name}
    pairs = _tried(judge, held, first.candidate, others, rules, advance)
    def together(pair: Judged) -> float:
        new = pair.candidate
        return fidelity(held, null.held_prediction, new.held_prediction, new.error)

    second = _leader(
        [p for p in pairs if p.accepted(rules, second=True) and (sole or together(p) > rules.least_fidelity)]
    )
    if second is None:
        return Search(null, singles, pairs, first.candidate if sole else null)
    pair, leader = second.candidate, effects[first.name]
    if in_range(pair, leader, rules.range_slack, reaching=False):
        return Search(null, singles, pairs, pair)
    if not in_range(pair, leader, rules.range_slack):  # the first stood in for the second
        instead = next((s for s in singles if s.name == second.name and s.accepted(rules)), None)
        return Search(null, singles, pairs, null if instead is None else instead.candidate)
    # Neither is determined beside the other: they are two names for one thing.
    return Search(null, singles, pairs, first.candidate if sole else null)


def _leader(accepted: Sequence[Judged]) -> Judged | None:
    """The strongest; of those that put right as much, the one of largest likelihood (one may hold the other)."""
    if not accepted:
        return None
    alike = [j for j in accepted if j.fidelity > accepted[0].fidelity - ALIKE]
    return max(alike, key=lambda j: j.delta_bic)


def _with_unbent(
    judge: Judge, held: Judge, null: Candidate, singles: Sequence[Judged], effects: Mapping[str, Effect], rules: Rules
) -> list[Judged]:
    """The singles with those added, or bettered, that the nominal fit may have bent around: searched from afar."""
    error = np.maximum(null.error, LEAST_ERROR)
    kept = {j.name: j for j in singles}
    for effect in effects.values():
        if effect.bends:
            before = kept.get(effect.name)
            middle = Screened(effect, effect.probes[len(effect.probes) // 2], 0.0, 0.0, [])
            screened = middle if before is None else before.screened
            candidate = unbent(judge, held, effect, screened.probe, error)
            found = judged(judge, held, null, candidate, screened, rules)
            if before is None or found.delta_bic > before.delta_bic:
                kept[effect.name] = found
    return sorted(kept.values(), key=lambda j: j.strength, reverse=True)


def _promising(screened: Sequence[Screened], rules: Rules, fewest: int) -> list[Screened]:
    """What is worth a refit: candidates that by screening gain enough, alone and against the best."""
    best = screened[0].gain if screened else 0.0
    least = max(rules.least_gain, rules.promising * best)
    return [s for k, s in enumerate(screened[: rules.refitted]) if s.gain > least or k < fewest]


def _tried(
    judge: Judge,
    held: Judge,
    base: Candidate,
    effects: Mapping[str, Effect],
    rules: Rules,
    advance: Callable[..., None],
) -> list[Judged]:
    """The most promising effects refitted beside ``base``, best first by what they gain on the fitted records."""
    error = np.maximum(base.error, LEAST_ERROR)
    chosen = _promising(screen(judge, base, effects, error), rules, 0 if base.names else 2)
    advance(note="screening")
    found = []
    for screened in chosen:
        found.append((refit(judge, held, base, screened, error), screened))
        advance(note=screened.effect.name)
    found.sort(key=lambda pair: float(pair[0].fitted.sum()), reverse=True)
    final = [(settled(judge, held, c) if k == 0 else c, s) for k, (c, s) in enumerate(found)]
    result = [judged(judge, held, base, c, s, rules) for c, s in final]
    return sorted(result, key=lambda j: j.strength, reverse=True)
