"""Whether controllers are safe, in words made from the gates, the linear proof and the episodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

Record = Mapping[str, Any]


class Safety(NamedTuple):
    """Of one controller: places of the linear proof and how many are unstable, unstable episodes that count.

    ``judged`` leaves out the places where the reference itself is unstable; ``own`` are those of them
    where the controller's loop is unstable too. ``worst`` says where the loop grows fastest.
    """

    safe: bool
    judged: int
    failing: int
    own: int
    episodes: int
    worst: str

    @property
    def verdict(self) -> Markup:
        """One or two words, coloured."""
        word, kind = ("unsafe", "bad") if not self.safe else ("safe", "good") if self.judged else ("not proven", "open")
        return Markup('<b class="{}">{}</b>').format(kind, word)

    @property
    def counts(self) -> str:
        """What the verdict rests on."""
        if self.safe:
            own = f" (unstable at {self.own} where the reference itself is)" if self.own else ""
            return f"stable at {self.judged} places{own}" if self.judged else "no unstable episode"
        counts = []
        if self.failing:
            counts.append(f"at {self.failing}{f' of {self.judged}' if self.judged else ''} places of the proof")
        if self.episodes:
            counts.append(f"in {self.episodes} episode{'s' * (self.episodes > 1)}")
        return f"unstable {' and '.join(counts)}"

    @property
    def words(self) -> str:
        """The counts and, where it is unsafe, the worst of them."""
        return self.counts if self.safe else f"{self.counts}; worst: {self.worst}"


def safeties(
    standings: Iterable[Record], summary: Record, where: tuple[str, str] | None = None
) -> dict[str, Safety]:
    """Safety by controller, over everything or at one (plant, causality)."""
    gates = _at(summary.get("gates") or (), where)
    places = _at(summary.get("assessments") or (), where)
    return {standing["controller"]: _safety(standing, gates, places) for standing in standings}


def unstable_at(assessments: Iterable[Record], name: str) -> list[Record]:
    """Places of a controller where it is to blame for an unstable loop, the fastest growing first."""
    own = [a for a in assessments if a["controller"] == name and a["reference_stable"] and not a["stable"]]
    return sorted(own, key=lambda a: -a["growth"])


def place_words(a: Record) -> str:
    """Where an assessment or a confirmation is."""
    point = a["point"].replace("_", ", ")
    return f"{a['plant']} {a['causality']}, {a['speed_kmh']:g} km/h, {point}, {a['arm'].replace('_', ' ')} arm"


def _safety(standing: Record, gates: Sequence[Record], places: Sequence[Record]) -> Safety:
    name, reasons = standing["controller"], list(standing["why_unsafe"])
    proof = [reason for gate in gates if gate["controller"] == name for reason in gate["failures"]]
    of_proof = [reason for reason in reasons if reason in proof]
    here = [a for a in places if a["controller"] == name]
    found = unstable_at(here, name)
    worst = (of_proof or reasons or [""])[0]
    if found:
        worst = f"{place_words(found[0])}: grows by {found[0]['growth']:.1f} 1/s at {found[0]['frequency_Hz']:.1f} Hz"
    return Safety(
        safe=bool(standing["safe"]),
        judged=sum(a["reference_stable"] for a in here),
        failing=len(of_proof),
        own=sum(not a["reference_stable"] and not a["stable"] for a in here),
        episodes=len(reasons) - len(of_proof),
        worst=worst,
    )


def _at(records: Iterable[Record], where: tuple[str, str] | None) -> list[Record]:
    return [r for r in records if where in (None, (r["plant"], r["causality"]))]
