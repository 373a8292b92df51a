"""The answer: who comes first, how sure that is, why, and who is unsafe; every sentence from the numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from experiments.report.benchmark_intervals import intervals
from experiments.report.benchmark_safety import Safety, safeties
from experiments.report.benchmark_scope import all_words
from experiments.report.benchmark_scores import by_everything, cell_of, columns_of, score_maps
from experiments.report.page import Report
from experiments.report.style import Look

Record = Mapping[str, Any]
Result = dict[str, Any]
Looks = Mapping[str, Look]


def answer(report: Report, summary: Record, looks: Looks) -> None:
    """Key numbers, the sentences, the ranking table and its figure."""
    ranking: Sequence[Record] = summary["ranking"]
    found = safeties(ranking, summary)
    report.key_numbers(_key_numbers(ranking, looks))
    report.text(" ".join([*_first(ranking, looks), *_where_it_leads(ranking, summary, looks)]))
    for remark in _unsafe(ranking, found, looks):
        report.text(f"> {remark}")
    report.table(
        ["rank (95\u00a0%)", "controller", "score\u00a0[JND] (95\u00a0%)", "best", "unstable", "safety"],
        [_row(standing, found[standing["controller"]], looks) for standing in ranking],
        f"{all_words(summary)}. Score: interquartile mean over the test cases of the distance to the reference, in "
        "just noticeable differences (JND). In brackets the 95 % intervals; best: chance of being the best; both from "
        "a bootstrap. An unsafe controller stands behind every safe one. Unstable: episodes, those with an unstable "
        "reference too.",
        dense=True,
    )
    report.figure(
        intervals(ranking, summary.get("systems") or (), looks),
        "Score and its 95 % interval; further left is nearer to the reference. Dashed line: 1 JND, what a driver "
        "begins to notice. Hollow: unsafe there.",
    )


def where_from(report: Report, scored: Sequence[Result], looks: Looks) -> None:
    """Scores by system, manoeuvre, arm and speed; ``looks`` are in the order of the ranking."""
    if not scored:
        return
    driven = {result["case"]["controller"] for result in scored}
    names = [name for name in looks if name in driven]
    report.section("Where the score comes from")
    report.text(" ".join(_why(names, scored, looks)))
    report.figure(
        score_maps({("", ""): by_everything(scored)}, names, looks),
        "Score in JND (interquartile mean) by system, manoeuvre, arm and speed; blue is below 1 JND, red above. "
        "×: unstable episodes among these cases. Hover for the worst case.",
    )


def _key_numbers(ranking: Sequence[Record], looks: Looks) -> list[tuple[str, str]]:
    best, safe = ranking[0], sum(standing["safe"] for standing in ranking)
    label = looks[best["controller"]].label
    cases, unstable = (sum(standing[key] for standing in ranking) for key in ("cases", "unstable"))
    numbers = []
    if best["safe"]:
        low, high = best["score_interval"]
        numbers = [
            (f"{best['score']:.2f} JND", f"{label}, the first (95\u00a0%: {low:.2f} to {high:.2f})"),
            (f"{100.0 * best['chance_of_best']:.0f} %", f"chance that {label} is the best"),
        ]
    return [
        *numbers,
        (f"{safe} of {len(ranking)}", "controllers are safe"),
        (f"{unstable:,} of {cases:,}", "episodes turned unstable"),
    ]


def _first(ranking: Sequence[Record], looks: Looks) -> list[str]:
    best, rest = ranking[0], ranking[1:]
    if not best["safe"]:
        return [f"No controller is safe; {_bold(best, looks)} has the lowest score of them, {best['score']:.2f} JND."]
    low, high = best["score_interval"]
    if high < 1.0:
        noticed = ", less than a driver begins to notice (1 JND)"
    elif low > 1.0:
        noticed = ", more than a driver begins to notice (1 JND)"
    else:
        noticed = "; whether a driver begins to notice (1 JND) lies inside the interval"
    sentences = [
        f"{_bold(best, looks)} comes first: over the middle half of its {best['cases']} cases it is "
        f"{best['score']:.2f} JND from the reference (95\u00a0%: {low:.2f} to {high:.2f}){noticed}."
    ]
    if not rest:
        return [*sentences, "It was the only one scored."]
    rivals = [s for s in rest if s["safe"] and s["rank_interval"][0] == 1]
    if not rivals:
        alone = f"No other safe controller reaches rank 1 within 95 % of the resamplings{_gap(ranking, looks)}."
        return [*sentences, alone]
    listed = " and ".join(
        f"{_bold(s, looks)} ({s['score']:.2f} JND, best in {100.0 * s['chance_of_best']:.0f} %)" for s in rivals
    )
    sentences.append(f"That is not certain: within 95 % of the resamplings {listed} can come first too.")
    likely = max(ranking, key=lambda s: s["chance_of_best"])
    if likely is not best:
        sentences.append(f"Resampling even puts {_bold(likely, looks)} first more often than {_bold(best, looks)}.")
    return sentences


def _gap(ranking: Sequence[Record], looks: Looks) -> str:
    second = next((s for s in ranking[1:] if s["safe"]), None)
    if second is None or ranking[0]["score"] <= 0.0:
        return ""
    return f"; the next, {_bold(second, looks)}, is {second['score'] / ranking[0]['score']:.2f} times as far"


def _where_it_leads(ranking: Sequence[Record], summary: Record, looks: Looks) -> list[str]:
    systems: Sequence[Record] = summary.get("systems") or ()
    if len(systems) < 2 or len(ranking) < 2:
        return []
    leaders: dict[str, list[str]] = {}
    for system in systems:
        first, *rest = system["ranking"]
        name = first["controller"] if first["safe"] else ""
        sure = not any(s["safe"] and s["rank_interval"][0] == 1 for s in rest)
        where = f"{system['plant']} {system['causality']}"
        leaders.setdefault(name, []).append(where if sure or not name else f"{where} (not certain)")
    parts = [
        f"{_name(name, looks)} in {', '.join(where)}" if name else f"nobody safe in {', '.join(where)}"
        for name, where in leaders.items()
    ]
    return [f"By system, first are: {'; '.join(parts)}."]


def _unsafe(ranking: Sequence[Record], found: Mapping[str, Safety], looks: Looks) -> list[str]:
    remarks = []
    by_score = sorted(ranking, key=lambda s: s["score"])
    for standing in ranking:
        if standing["safe"]:
            continue
        rank = by_score.index(standing) + 1
        lost = f" By score alone it would stand at rank {rank}." if rank < standing["rank"] else ""
        words = escape(found[standing["controller"]].words)
        remarks.append(f"{_bold(standing, looks)} is unsafe: {words}.{lost}")
    unproven = [s for s in ranking if s["safe"] and not found[s["controller"]].judged]
    if unproven:
        names = ", ".join(_bold(s, looks) for s in unproven)
        remarks.append(f"No linear proof of stability: {names}. Only their episodes speak for them.")
    return remarks


def _row(standing: Record, safety: Safety, looks: Looks) -> list[object]:
    (low, high), (first, last) = standing["score_interval"], standing["rank_interval"]
    return [
        f"{standing['rank']} ({first}–{last})", looks[standing["controller"]].label,
        f"{standing['score']:.2f} ({low:.2f}–{high:.2f})", f"{100.0 * standing['chance_of_best']:.0f} %",
        f"{standing['unstable']} of {standing['cases']}", Markup("{}: {}").format(safety.verdict, safety.words),
    ]  # fmt: skip


def _why(names: Sequence[str], scored: Sequence[Result], looks: Looks) -> list[str]:
    """Where the first is near and far, and against whom it gains most."""
    best, rest = names[0], names[1:]
    own = _by_manoeuvre(best, scored)
    if len(own) < 2:
        return []
    near, far = min(own, key=lambda m: own[m]), max(own, key=lambda m: own[m])
    sentences = [
        f"{_name(best, looks)} is nearest to the reference in {near} ({own[near]:.2f} JND) and farthest from it in "
        f"{far} ({own[far]:.2f} JND)."
    ]
    if rest:
        lead = {m: value - own[m] for m, value in _by_manoeuvre(rest[0], scored).items()}
        most, least = max(lead, key=lambda m: lead[m]), min(lead, key=lambda m: lead[m])
        gains = [f"gains most in {most} ({lead[most]:.2f} JND)"] if lead[most] > 0.0 else []
        gains += [f"loses most in {least} ({-lead[least]:.2f} JND)"] if lead[least] < 0.0 else []
        sentences.append(f"Against {_name(rest[0], looks)} it {' and '.join(gains) or 'neither gains nor loses'}.")
    return sentences


def _by_manoeuvre(name: str, scored: Sequence[Result]) -> dict[str, float]:
    own = [result for result in scored if result["case"]["controller"] == name]
    cells = {label: cell_of(cases) for label, cases in columns_of(own, lambda case: case["manoeuvre"])}
    return {label.replace("_", " "): cell.score for label, cell in cells.items() if cell is not None}


def _name(name: str, looks: Looks) -> Markup:
    return Markup("<b>{}</b>").format(looks[name].label)


def _bold(standing: Record, looks: Looks) -> Markup:
    return _name(standing["controller"], looks)
