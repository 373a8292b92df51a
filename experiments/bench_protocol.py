"""The protocol of the benchmark: what is driven, on which plants, and how it is scored. A data file.

``benchmark_v1.json`` is fixed: a change that changes scores is a new file and a new version. Training
cases (for tuning and learning) and test cases draw their plants, cars and arms from seed ranges that
do not meet, and ``score`` takes test cases only.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from experiments.bench_cases import Case

LATEST = "benchmark_v1"
SPLITS = ("training", "test")
DRAWN_ARM = "drawn"  # an arm between those of the grid, drawn with the plant


@dataclass(frozen=True)
class Protocol:
    """Fields of the data file; ``score`` names the metrics whose mean is a case's score in JND."""

    name: str
    plants: tuple[str, ...]
    causalities: tuple[str, ...]
    speeds_kmh: tuple[float, ...]
    arms: tuple[str, ...]
    manoeuvres: tuple[str, ...]
    settle_s: float
    draws: int
    draw_seeds: dict[str, list[int]]
    quick: dict[str, Any]
    score: dict[str, list[str]]
    worst_score_jnd: float
    bootstrap: dict[str, float]

    @classmethod
    @cache
    def load(cls, name: str = LATEST) -> Protocol:
        """The protocol of that name, as shipped."""
        content: dict[str, Any] = json.loads(Path(__file__).with_name(f"{name}.json").read_text("utf-8"))
        for field in fields(cls):
            if str(field.type).startswith("tuple"):
                content[field.name] = tuple(content[field.name])
        return cls(**content)

    def test_cases(self, controller: str, quick: bool = False) -> list[Case]:
        """The cases of one controller that are scored; ``quick``: a part of them."""
        speeds, arms, draws = self.speeds_kmh, self.arms, self.draws
        if quick:
            speeds, arms, draws = tuple(self.quick["speeds_kmh"]), tuple(self.quick["arms"]), self.quick["draws"]
        return [
            Case(plant, causality, controller, float(speed), manoeuvre, arm, split="test", draw=k)
            for plant, causality, speed, manoeuvre, arm, k in product(
                self.plants, self.causalities, speeds, self.manoeuvres, arms, range(draws)
            )
        ]

    def training_cases(
        self, controller: str, plant: str, causality: str, speeds_kmh: tuple[float, ...], draws: int
    ) -> list[Case]:
        """Cases for tuning: every manoeuvre at the speeds, plants and arms drawn from the training seeds."""
        return [
            Case(plant, causality, controller, float(speed), manoeuvre, DRAWN_ARM, split="training", draw=k)
            for speed, manoeuvre, k in product(speeds_kmh, self.manoeuvres, range(draws))
        ]
