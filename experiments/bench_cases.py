"""What the benchmark drives: one Case per episode, and how a case becomes a result."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

import controllers
from experiments.bench_plots import compact_plot, last_cycle
from experiments.measures import Array
from experiments.metrics import Trial, analytic_response, score
from experiments.rollout import Episode, run
from steer_env.envs.draws import random_car, random_driver
from steer_env.envs.layout import CarSpread
from steer_env.envs.task import Task
from steer_env.interface import Controller
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

Maker = Callable[[Plant, Reference, str], Controller]

PLANT_NAMES = ("EPAS", "SbW")
SPEEDS_KMH = (45.0, 75.0, 105.0)
MANOEUVRES = ("frequency_response", "steady_state")
ARMS = ("relaxed", "tense")
FAST_CHIRP, ROBOT = "high_frequency_response", "robot"  # beyond what arms can drive
RAMP = "constant_speed_cornering"  # slow, from the centre: shows the dead band
LINEAR_SPEED_KMH = 75.0  # the paper's Figure 9
SETTLE_S = 1.0  # rest after the manoeuvre, so that a response is transformed without a window
LOOP_POINTS = 400  # per hysteresis loop kept for plots


@dataclass(frozen=True)
class Case:
    """One episode. ``linear`` takes Eq. 10; ``prompt`` a plant without any delay or sensor noise.

    The prompt plant is the limit case that tells what delay and sensors cost. ``split`` says from
    which seeds plant, car and the manoeuvre's size are drawn, "training" or "test", and ``draw``
    counts the draws; without a split the plant is the nominal one and the manoeuvre the paper's.
    """

    plant: str
    causality: str
    controller: str
    speed_kmh: float
    manoeuvre: str
    arm: str
    linear: bool = False
    prompt: bool = False
    split: str = ""
    draw: int = 0

    @property
    def place(self) -> str:
        """A name of what is driven, whoever controls it."""
        marks = ("_linear" if self.linear else "") + ("_prompt" if self.prompt else "")
        marks += f"_{self.split}{self.draw}" if self.split else ""
        return f"{self.plant}_{self.causality}_{self.speed_kmh:03.0f}_{self.manoeuvre}_{self.arm}{marks}"

    @property
    def name(self) -> str:
        """A name of the whole case."""
        return f"{self.place}_{self.controller}"


def grid(
    names: Sequence[str] = tuple(controllers.CONTROLLERS),
    speeds_kmh: Sequence[float] = SPEEDS_KMH,
    arms: Sequence[str] = ARMS,
) -> list[Case]:
    """Every plant x causality x controller x speed x manoeuvre x arm, slow ramp, linear chirps, the fast one."""
    combinations = list(product(PLANT_NAMES, controllers.CAUSALITIES, names))
    cases = [
        Case(plant, causality, name, speed, manoeuvre, arm)
        for plant, causality, name in combinations
        for speed, manoeuvre, arm in product(speeds_kmh, MANOEUVRES, arms)
    ]
    chirp = MANOEUVRES[0]
    for plant, causality, name in combinations:
        cases.append(Case(plant, causality, name, LINEAR_SPEED_KMH, FAST_CHIRP, ROBOT))
        cases.append(Case(plant, causality, name, LINEAR_SPEED_KMH, RAMP, arms[0]))
        for arm in arms:
            cases.append(Case(plant, causality, name, LINEAR_SPEED_KMH, chirp, arm, linear=True))
        if name != "open_loop_map":
            limit = Case(plant, causality, name, LINEAR_SPEED_KMH, chirp, arms[0], True, True)
            cases.append(limit)
    return cases


def prompt_plant(plant: Plant) -> Plant:
    """The plant with a fast motor and perfect sensors: no dead time, latency, noise or steps."""
    sensors = plant.sensors._replace(
        angle_step=0.0, angle_noise=0.0, angle_delay=0.0,
        torque_step=0.0, torque_noise=0.0, torque_delay=0.0,
    )  # fmt: skip
    motor = plant.motor._replace(dead_time=0.0, bandwidth_Hz=5000.0)
    return replace(plant, motor=motor, sensors=sensors)


def number_of(name: str) -> int:
    """A number that follows from a name alone, on every machine."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")


def draw_seed(case: Case, seeds: Sequence[int]) -> int:
    """The seed of a case's plant: inside ``seeds`` (first, end), the same for every controller."""
    return seeds[0] + number_of(case.place) % (seeds[1] - seeds[0])


def task_of(case: Case, reference: Reference, seeds: Sequence[int] = ()) -> Task:
    """What is driven; a case with a split draws its plant, car, arm and size from ``seeds``."""
    plant: Plant = PLANTS[case.plant]
    if case.prompt:
        plant = prompt_plant(plant)
    driver, car = DRIVERS.get(case.arm), CarSpread()
    randomise: tuple[str, ...] = ()
    if case.split:
        rng = np.random.default_rng(draw_seed(case, seeds))
        plant, car = plant.drawn(rng), random_car(rng)
        driver = driver or random_driver(rng)
        randomise = ("manoeuvre",)
    return Task(
        plant=plant,
        causality=case.causality,
        reference=reference,
        linear=case.linear,
        car_spread=car,
        manoeuvre=case.manoeuvre,
        speed_kmh=case.speed_kmh,
        driver=driver or case.arm,
        randomise=randomise,
    )


def episode_of(
    case: Case, reference: Reference, seed: int, seeds: Sequence[int] = (), make: Maker | None = None
) -> Episode:
    """Drive one case; ``make`` stands in for the controller of that name.

    Noise follows from the seed and the place: the order does not matter, and all controllers get the same.
    The controller knows the nominal plant.
    """
    task = task_of(case, reference, seeds)
    make = make or partial(controllers.make, case.controller)
    assert isinstance(task.plant, Plant)
    controller = make(task.plant.believed(), Reference.load(reference, case.linear), case.causality)
    return run(task, controller, (seed, number_of(case.place)), SETTLE_S)


def trial_of(case: Case, episode: Episode) -> Trial:
    """What the metrics look at."""
    return Trial(episode, case.causality, case.linear, case.manoeuvre)


def result_of(
    case: Case, reference: Reference, seed: int, seeds: Sequence[int] = (), make: Maker | None = None
) -> dict[str, Any]:
    """Scores and plot data of one case as plain JSON values; no scores where unstable."""
    return scored_result(case, episode_of(case, reference, seed, seeds, make))


def scored_result(case: Case, episode: Episode) -> dict[str, Any]:
    """The same of a case that was driven already."""
    result: dict[str, Any] = {"case": asdict(case), "stable": episode.stable}
    if not episode.stable:
        return {**result, "scores": {}, "plot": {}, "stopped_after_s": float(episode["time"][-1])}
    trial = trial_of(case, episode)
    scores = {k: v if np.isfinite(v) else None for k, v in score(trial).items()}
    if case.split or case.manoeuvre not in MANOEUVRES:
        plot = compact_plot(trial) if case.draw == 0 else {}
    else:
        arrays = _response(trial) if case.manoeuvre == MANOEUVRES[0] else last_cycle(trial, LOOP_POINTS)
        plot = {name: values.tolist() for name, values in arrays.items()}
    return {**result, "scores": scores, "plot": plot}


def _response(trial: Trial) -> dict[str, Array]:
    H = trial.response
    plot: dict[str, Array] = {"frequency_Hz": H.frequency, "coherence": H.coherence}
    for name, value in (("achieved", H.value), ("reference", trial.reference_response)):
        plot[f"{name}_real"], plot[f"{name}_imag"] = value.real, value.imag
    if trial.linear:
        fine = np.geomspace(0.2, 5.0, 120)
        exact = analytic_response(trial.episode, fine)
        plot |= {"exact_Hz": fine, "exact_real": exact.real, "exact_imag": exact.imag}
    return plot
