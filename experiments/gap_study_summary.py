"""What a blind study of the gap workflow adds up to."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np

from steer_env.physics.effects import EFFECTS

Entry = dict[str, Any]
BINS = 4  # of the detection curve, from the lower to the upper end of the plausible range


def named(entry: Entry) -> list[str]:
    """Names that the workflow gave."""
    return [e["name"] for e in entry["effects"]] if entry["verdict"] == "effect" else []


def strength(entry: Entry) -> float:
    """Where the amplitude of a hidden single effect lies in its plausible range, 0 to 1 (log scale but for ratios)."""
    ((name, parameters),) = entry["hidden"].items()
    effect = EFFECTS["vehicle"][name]
    plausible, value = effect.plausible[effect.amplitude], parameters[effect.amplitude]
    absent = float(getattr(effect.absent(), effect.amplitude))
    if plausible.low < absent < plausible.high:
        return abs(value - absent) / max(plausible.high - absent, absent - plausible.low)
    share = float(np.log(abs(value) / plausible.low) / np.log(plausible.high / plausible.low))
    return 1.0 - share if effect.amplitude == "torque_Nm" and name == "assist_saturation" else share


def summary(entries: Sequence[Entry]) -> dict[str, Any]:
    """Rates with their counts, the detection curve, confusions, interval coverage and reliability."""
    single = [e for e in entries if e["kind"] == "single"]
    none = [e for e in entries if e["kind"] == "none"]
    outside = [e for e in entries if e["kind"] == "outside"]
    pair = [e for e in entries if e["kind"] == "pair"]
    right = [e for e in single if named(e) == list(e["hidden"])]
    strong = [e for e in single if strength(e) > 0.5]
    figures = {
        "single effect named exactly": _rate(right, single),
        "single effect first in the ranking": _rate(
            [e for e in single if e["ranking"] and e["ranking"][0]["name"] in e["hidden"]], single
        ),
        "single effect named exactly, upper half of its range": _rate(
            [e for e in strong if named(e) == list(e["hidden"])], strong
        ),
        "single effect missed (none)": _rate([e for e in single if e["verdict"] == "none"], single),
        "single effect called unknown": _rate([e for e in single if e["verdict"] == "unknown"], single),
        "single effect with a wrong name": _rate([e for e in single if set(named(e)) - set(e["hidden"])], single),
        "nothing hidden, nothing named": _rate([e for e in none if e["verdict"] == "none"], none),
        "false alarm: nothing hidden, something named": _rate([e for e in none if named(e)], none),
        "outside the catalogue, called unknown": _rate([e for e in outside if e["verdict"] == "unknown"], outside),
        "outside the catalogue, falsely named": _rate([e for e in outside if named(e)], outside),
        "pair, both named": _rate([e for e in pair if set(named(e)) == set(e["hidden"])], pair),
        "pair, one named and no wrong one": _rate(
            [e for e in pair if len(named(e)) == 1 and set(named(e)) < set(e["hidden"])], pair
        ),
        "pair, a wrong name": _rate([e for e in pair if set(named(e)) - set(e["hidden"])], pair),
    }
    compared = [e for e in single if e.get("baseline")]
    quiet = [e for e in none if e.get("baseline")]
    figures["baseline (sparse regression): single effect named"] = _rate(
        [e for e in compared if e["baseline"] in e["hidden"]], compared
    )
    figures["baseline: nothing hidden, something named"] = _rate(
        [e for e in quiet if e["baseline"] != "none"], quiet
    )
    return {
        "schema_version": 1,
        "cases": len(entries),
        "seeds": [min(e["seed"] for e in entries), max(e["seed"] for e in entries)],
        "figures": figures,
        "detection_curve": _curve(single),
        "by_effect": _by_effect(single),
        "by_campaign": _by_campaign(single),
        "confusion": dict(
            Counter(f"{'+'.join(e['hidden']) or e['outside'] or 'none'} -> {_label(e)}" for e in entries)
        ),
        "coverage_ci95": _coverage(right),
        "gap_after_over_noise": _median(
            [e["gap"]["after"] / e["gap"]["noise_floor"] for e in right if e["gap"]["noise_floor"]]
        ),
        "gap_before_over_noise": _median(
            [e["gap"]["before"] / e["gap"]["noise_floor"] for e in right if e["gap"]["noise_floor"]]
        ),
        "reliability": reliability(entries),
        "seconds_median": _median([e["seconds"] for e in entries]),
    }


def _label(entry: Entry) -> str:
    return "+".join(named(entry)) or str(entry["verdict"])


def _rate(some: Sequence[Entry], of: Sequence[Entry]) -> dict[str, Any]:
    return {"value": round(len(some) / len(of), 3) if of else None, "count": len(some), "of": len(of)}


def _curve(single: Sequence[Entry]) -> list[dict[str, Any]]:
    """Share of singles named exactly over the place of the amplitude in its range."""
    found = []
    for k in range(BINS):
        here = [
            e for e in single if k / BINS <= min(strength(e), 0.999) < (k + 1) / BINS or (k == 0 and strength(e) < 0)
        ]
        found.append(
            {"from": k / BINS, "to": (k + 1) / BINS, **_rate([e for e in here if named(e) == list(e["hidden"])], here)}
        )
    return found


def _by_effect(single: Sequence[Entry]) -> dict[str, Any]:
    groups: dict[str, list[Entry]] = defaultdict(list)
    for entry in single:
        groups[next(iter(entry["hidden"]))].append(entry)
    return {n: _rate([e for e in g if named(e) == [n]], g) for n, g in sorted(groups.items())}


def _by_campaign(single: Sequence[Entry]) -> dict[str, Any]:
    groups: dict[str, list[Entry]] = defaultdict(list)
    for entry in single:
        groups[entry["campaign"]].append(entry)
    return {n: _rate([e for e in g if named(e) == list(e["hidden"])], g) for n, g in sorted(groups.items())}


def _coverage(right: Sequence[Entry]) -> dict[str, Any]:
    """Share of 95 % intervals of amplitudes that hold the truth."""
    inside = []
    for entry in right:
        for effect in entry["effects"]:
            amplitude = EFFECTS["vehicle"][effect["name"]].amplitude
            low, high = effect["parameters"][amplitude]["ci95"]
            truth = entry["hidden"][effect["name"]][amplitude]
            if EFFECTS["vehicle"][effect["name"]].plausible[amplitude].low >= 0.0 and "phase" in effect["parameters"]:
                truth = abs(truth)
            inside.append(low <= truth <= high)
    return {"value": round(float(np.mean(inside)), 3) if inside else None, "of": len(inside)}


def reliability(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Claimed probability of names against how often they were right, in three bins."""
    claims = [
        (e["effects"][k]["probability"], e["effects"][k]["name"] in e["hidden"])
        for e in entries
        for k in range(len(named(e)))
    ]
    found = []
    for low, high in ((0.0, 0.8), (0.8, 0.95), (0.95, 1.001)):
        here = [(p, ok) for p, ok in claims if low <= p < high]
        if here:
            mean, share = (float(np.mean(column)) for column in zip(*here, strict=True))
            found.append(
                {
                    "from": low,
                    "to": min(high, 1.0),
                    "claimed": round(mean, 3),
                    "right": round(share, 3),
                    "of": len(here),
                }
            )
    return found


def _median(values: Sequence[float]) -> float | None:
    return round(float(np.median(values)), 3) if values else None
