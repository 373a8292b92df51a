"""Draws what is driven in training: plants, cars and arms of the benchmark's training seeds, never of its test ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from experiments.bench_cases import SETTLE_S
from experiments.bench_protocol import Protocol
from experiments.learning.config import Domain
from steer_env.envs.draws import random_car, random_driver
from steer_env.envs.layout import LINE_LENGTH, PERIOD, CarSpread
from steer_env.envs.task import Setup, Task, prepare
from steer_env.errors import InputError
from steer_env.manoeuvres import MANOEUVRES
from steer_env.plants import DRIVERS, PLANTS, Reference

NOMINAL_ARM = "relaxed"
FREE_ARM, FREE_MANOEUVRE = "torque_source", "random_torque"


@dataclass(frozen=True)
class Drawer:
    """Draws an episode for one plant, causality and reference from a generator."""

    plant: str
    causality: str
    reference: Reference
    domain: Domain

    def __post_init__(self) -> None:
        for name in self.domain.manoeuvres:
            if name not in MANOEUVRES:
                raise InputError("domain.manoeuvres", f"{name!r} is not known", f"use names of {', '.join(MANOEUVRES)}")
        known, (slowest, fastest) = self.reference.file.rows, self.domain.speeds_kmh
        if not max(known[0].speed_kmh, slowest) <= min(known[-1].speed_kmh, fastest):
            there = f"{known[0].speed_kmh:g} to {known[-1].speed_kmh:g} km/h"
            raise InputError("domain.speeds_kmh", f"none of {there} is in it", "give slowest,fastest")

    def draw(self, rng: np.random.Generator) -> tuple[Setup, int]:
        """(What to simulate, for how many control periods, a second of rest at the end included)."""
        domain = self.domain
        plant, car, driver = PLANTS[self.plant], CarSpread(), DRIVERS[NOMINAL_ARM]
        if domain.randomise:
            first, end = Protocol.load().draw_seeds["training"]
            own = np.random.default_rng(int(rng.integers(first, end)))
            plant, car, driver = plant.drawn(own), random_car(own), random_driver(own)
        if domain.extra_dead_time:
            late = plant.motor.dead_time + float(rng.integers(0, domain.extra_dead_time + 1))
            plant = replace(plant, motor=plant.motor._replace(dead_time=min(late, LINE_LENGTH - 1.0)))
        manoeuvre = str(rng.choice(domain.manoeuvres))
        if rng.uniform() < domain.free_share:
            driver, manoeuvre = DRIVERS[FREE_ARM], FREE_MANOEUVRE
        slowest, fastest = self.domain.speeds_kmh
        known = [row.speed_kmh for row in self.reference.file.rows]
        task = Task(
            plant=plant,
            causality=self.causality,
            reference=self.reference,
            car_spread=car,
            driver=driver,
            manoeuvre=manoeuvre,
            speed_kmh=float(rng.uniform(max(min(known), slowest), min(max(known), fastest))),
            randomise=("manoeuvre",),
        )
        setup = prepare(task, rng, PERIOD)
        return setup, setup.periods + round(SETTLE_S / PERIOD)
