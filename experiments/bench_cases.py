"""What the benchmark drives: one Case per episode, and how a case becomes a result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import controllers
from experiments.metrics import Trial, analytic_response, score
from experiments.rollout import Episode, run
from steer_env.envs.task import Task
from steer_env.plants import PLANTS, Plant, Reference

PLANT_NAMES = ("EPAS", "SbW")
SPEEDS_KMH = (45.0, 75.0, 105.0)
MANOEUVRES = ("frequency_response", "steady_state")
ARMS = ("relaxed", "tense")
LINEAR_SPEED_KMH = 75.0  # the paper's Figure 9
SETTLE_S = 1.0  # rest after the manoeuvre, so that a response is transformed without a window
LOOP_POINTS = 400  # per hysteresis loop kept for plots


@dataclass(frozen=True)
class Case:
    """One episode. ``linear`` takes Eq. 10; ``prompt`` a plant without any delay or sensor noise.

    The prompt plant is the limit case that tells what delay and sensors cost.
    """

    plant: str
    causality: str
    controller: str
    speed_kmh: float
    manoeuvre: str
    arm: str
    linear: bool = False
    prompt: bool = False

    @property
    def name(self) -> str:
        """A name that can be a file's."""
        marks = ("_linear" if self.linear else "") + ("_prompt" if self.prompt else "")
        where = f"{self.plant}_{self.causality}_{self.speed_kmh:03.0f}_{self.manoeuvre}_{self.arm}"
        return f"{where}{marks}_{self.controller}"


def grid(
    names: Sequence[str] = tuple(controllers.CONTROLLERS),
    speeds_kmh: Sequence[float] = SPEEDS_KMH,
    arms: Sequence[str] = ARMS,
) -> list[Case]:
    """Every plant x causality x controller x speed x manoeuvre x arm, and the linear chirps."""
    combinations = list(product(PLANT_NAMES, controllers.CAUSALITIES, names))
    cases = [
        Case(plant, causality, name, speed, manoeuvre, arm)
        for plant, causality, name in combinations
        for speed, manoeuvre, arm in product(speeds_kmh, MANOEUVRES, arms)
    ]
    chirp = MANOEUVRES[0]
    for plant, causality, name in combinations:
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


def episode_of(case: Case, reference: Reference, seed: int) -> Episode:
    """Drive one case. Noise follows from the seed and the case, so the order does not matter."""
    plant = PLANTS[case.plant]
    if case.prompt:
        plant = prompt_plant(plant)
    task = Task(
        plant=plant,
        causality=case.causality,
        reference=reference,
        linear=case.linear,
        manoeuvre=case.manoeuvre,
        speed_kmh=case.speed_kmh,
        driver=case.arm,
    )
    controller = controllers.make(
        case.controller, plant, Reference.load(reference, case.linear), case.causality
    )
    own = int.from_bytes(hashlib.sha256(case.name.encode()).digest()[:4], "big")
    return run(task, controller, (seed, own), SETTLE_S)


def result_of(case: Case, reference: Reference, seed: int) -> dict[str, Any]:
    """Scores and plot data of one case as plain JSON values; scores are None where unstable."""
    episode = episode_of(case, reference, seed)
    result: dict[str, Any] = {"case": asdict(case), "stable": episode.stable}
    if not episode.stable:
        return {**result, "scores": {}, "plot": {}, "stopped_after_s": float(episode["time"][-1])}
    trial = Trial(episode, case.causality, case.linear, case.manoeuvre)
    scores = {k: v if np.isfinite(v) else None for k, v in score(trial).items()}
    plot = _response(trial) if case.manoeuvre == MANOEUVRES[0] else _loops(trial)
    return {**result, "scores": scores, "plot": plot}


def _response(trial: Trial) -> dict[str, Any]:
    H = trial.response
    plot = {"frequency_Hz": H.frequency, "coherence": H.coherence}
    for name, value in (("achieved", H.value), ("reference", trial.reference_response)):
        plot[f"{name}_real"], plot[f"{name}_imag"] = value.real, value.imag
    if trial.linear:
        fine = np.geomspace(0.2, 5.0, 120)
        exact = analytic_response(trial.episode, fine)
        plot |= {"exact_Hz": fine, "exact_real": exact.real, "exact_imag": exact.imag}
    return {name: values.tolist() for name, values in plot.items()}


def _loops(trial: Trial) -> dict[str, Any]:
    plot = {}
    for name, of_ideal in (("achieved", False), ("reference", True)):
        angle, torque = trial.loop(of_ideal)
        cycle = round(1.0 / trial.episode.part("manoeuvre").frequency / 1e-3)
        step = max(cycle // LOOP_POINTS, 1)
        plot[f"{name}_angle_deg"] = np.degrees(angle[-cycle - 1 :: step]).tolist()
        plot[f"{name}_torque_Nm"] = torque[-cycle - 1 :: step].tolist()
    return plot


def key_of(case: Case, reference: Reference, seed: int) -> str:
    """A hash of everything a result depends on: the case, the reference, the seed, the code."""
    digest = hashlib.sha256(json.dumps([asdict(case), seed], sort_keys=True).encode())
    digest.update(reference.table.tobytes())
    digest.update(_code())
    return digest.hexdigest()[:12]


@cache
def _code() -> bytes:
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    folders = [root / "steer_env", root / "controllers"]
    files = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    for pattern in ("bench_cases.py", "measures*.py", "metrics*.py", "rollout.py"):
        files += sorted((root / "experiments").glob(pattern))
    for path in [*files, root / "identification" / "frf.py"]:
        digest.update(path.read_bytes())
    return digest.digest()
