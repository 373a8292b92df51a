"""On which systems a run ranks and which it leaves out, and what the learned policies in it are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from experiments.bench_systems import SYSTEMS, reasons_of, words_of
from experiments.report.page import Report
from experiments.report.style import Look

Record = Mapping[str, Any]
PLANTS = {"EPAS": "EPAS", "SbW": "steer-by-wire"}
CAUSALITIES = {"impedance": "torque tracking (impedance)", "admittance": "angle tracking (admittance)"}


def systems_in(summary: Record) -> list[tuple[str, str]]:
    """(Plant, causality) that were ranked; all where none was."""
    return [(s["plant"], s["causality"]) for s in summary.get("systems") or ()] or list(SYSTEMS)


def subtitle(summary: Record) -> str:
    """What was driven, in one line."""
    systems = systems_in(summary)
    plants = " and ".join(words for plant, words in PLANTS.items() if any(s[0] == plant for s in systems))
    causalities = " and ".join(words for c, words in CAUSALITIES.items() if any(s[1] == c for s in systems))
    return f"{plants[0].upper()}{plants[1:]}, {causalities}"


def all_words(summary: Record) -> str:
    """Name of the ranking over everything that was driven."""
    return f"Only {words_of(systems_in(summary))}" if summary.get("left_out") else "All systems"


def scope(report: Report, summary: Record) -> None:
    """What is left out and why; nothing for a run on everything."""
    left_out: Sequence[Record] = summary.get("left_out") or ()
    if left_out:
        driven = escape(words_of(systems_in(summary)))
        report.text(f"All controllers are ranked on {driven}. Left out: {escape(reasons_of(left_out))}.")


def policies(report: Report, summary: Record, looks: Mapping[str, Look]) -> None:
    """One sentence on each learned policy."""
    records: Sequence[Record] = summary.get("policies") or ()
    if records:
        told = " ".join(_policy(record, looks) for record in records)
        report.text(
            f"{told} What a policy learned from was drawn from the training seeds, none of which is scored; at a speed "
            "at which its loops would not bear all of its correction it does less."
        )


def _policy(record: Record, looks: Mapping[str, Look]) -> Markup:
    look = looks.get(record["controller"])
    base, steps, seed = record["base"], record["training_steps"], record["seed"]
    size = f"{record['authority_Nm']:.2g} N m at the motor"
    does = f"corrects {base} by up to {size}" if base else f"gives the whole torque, up to {size}"
    learned = f", learned in {steps:,} steps" if steps else ""
    learned += f" from seed {seed}" if seed is not None else ""
    return Markup("<b>{}</b> in {} {} is a small network that acts every {:g} ms and {}{}.").format(
        look.label if look else record["controller"], record["plant"], record["causality"], record["step_ms"], does,
        learned,
    )  # fmt: skip
