"""Impedance against admittance, on yardsticks that mean the same in both: felt torque and frequency response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from statistics import median
from typing import Any

from experiments.report.page import Report
from experiments.report.style import Look

Result = dict[str, Any]
Pair = tuple[float, float]  # impedance, admittance
YARDSTICKS = {"felt_torque_jnd": "felt torque", "frf_jnd": "frequency response"}
CLEAR = 0.05  # medians that differ by a smaller share are called alike
CAUSALITIES = ("impedance", "admittance")


def causality(report: Report, scored: Sequence[Result], looks: Mapping[str, Look]) -> None:
    """The section; nothing where a plant was not driven in both causalities."""
    plants = dict.fromkeys(r["case"]["plant"] for r in scored)
    paired = {plant: [r for r in scored if r["case"]["plant"] == plant] for plant in plants}
    paired = {plant: here for plant, here in paired.items() if pairs_of(here, "felt_torque_jnd")}
    if not paired:
        return
    report.section("Impedance against admittance")
    report.text(
        "The scores of the two track different signals and must not be compared. These yardsticks mean the same in "
        "both: the torque that is felt against the reference's at the true motion, and the frequency response against "
        "the reference's. Pairs: the same controller, speed, manoeuvre, arm and draw, stable in both causalities."
    )
    for plant, here in paired.items():
        report.text(sentence(plant, here))
    report.table(
        ["plant", "controller", *(f"{what}: {c} [JND]" for what in YARDSTICKS.values() for c in (*CAUSALITIES,)),
         "nearer in torque", "nearer in response", "pairs"],
        [row for plant, here in paired.items() for row in _rows(plant, here, looks)],
        f"Medians over pairs; a dash where they differ by less than {100.0 * CLEAR:.0f} %.",
        dense=True,
    )  # fmt: skip


def pairs_of(results: Sequence[Result], metric: str) -> dict[str, list[Pair]]:
    """(Impedance, admittance) of a metric by controller, over the places where both have it."""
    found: dict[tuple[Any, ...], dict[str, float]] = {}
    for result in results:
        case, value = result["case"], result["scores"].get(metric)
        if value is not None:
            key = tuple(case[k] for k in ("controller", "plant", "speed_kmh", "manoeuvre", "arm", "draw"))
            found.setdefault(key, {})[case["causality"]] = value
    whole = sorted(((key[0], tuple(both[c] for c in CAUSALITIES)) for key, both in found.items() if len(both) == 2))
    return {name: [(a, b) for _, (a, b) in group] for name, group in groupby(whole, key=lambda item: item[0])}


def nearer(pairs: Sequence[Pair]) -> str:
    """The causality with the clearly smaller median, or nothing."""
    impedance, admittance = (median(values) for values in zip(*pairs, strict=True))
    if abs(impedance - admittance) <= CLEAR * max(impedance, admittance):
        return ""
    return CAUSALITIES[int(admittance < impedance)]


def sentence(plant: str, results: Sequence[Result]) -> str:
    """What the pairs of one plant say, over all controllers."""
    told, verdicts = [], {}
    for metric, what in YARDSTICKS.items():
        pairs = [pair for own in pairs_of(results, metric).values() for pair in own]
        if pairs:
            verdicts[what] = nearer(pairs)
            share = sum(a < b for a, b in pairs) / len(pairs)
            a, b = (median(values) for values in zip(*pairs, strict=True))
            told.append(
                f"in {what} {a:.2f} JND against {b:.2f} JND (impedance is nearer in {100.0 * share:.0f} % "
                f"of {len(pairs)} pairs)"
            )
    text = f"**{plant}**, median of impedance against admittance: {', '.join(told)}. {_conclusion(verdicts)}"
    lost = [sum(r["case"]["causality"] == c and not r["stable"] for r in results) for c in CAUSALITIES]
    return f"{text} Unstable episodes: {lost[0]} in impedance, {lost[1]} in admittance." if any(lost) else text


def _conclusion(verdicts: Mapping[str, str]) -> str:
    sides = set(verdicts.values())
    if sides == {""}:
        return "Neither is clearly nearer to the reference."
    if len(sides) == 1:
        return f"{sides.pop().capitalize()} is nearer to the reference{' on both' if len(verdicts) > 1 else ''}."
    if "" in sides:
        what = next(name for name, side in verdicts.items() if side)
        return f"{verdicts[what].capitalize()} is nearer in {what} only."
    return "The two yardsticks disagree: " + ", ".join(f"{side} is nearer in {w}" for w, side in verdicts.items()) + "."


def _rows(plant: str, results: Sequence[Result], looks: Mapping[str, Look]) -> list[list[object]]:
    found = {metric: pairs_of(results, metric) for metric in YARDSTICKS}
    rows: list[list[object]] = []
    for name in looks:
        own = [found[metric].get(name, []) for metric in YARDSTICKS]
        if any(own):
            medians = [
                f"{median(values):.2f}" if pairs else None
                for pairs in own
                for values in (zip(*pairs, strict=True) if pairs else ((), ()))
            ]
            sides = [nearer(pairs) or None if pairs else None for pairs in own]
            rows.append([plant, looks[name].label, *medians, *sides, len(own[0])])
    return rows
