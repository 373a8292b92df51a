"""The benchmark through the CAN path: the protocol's steer-by-wire cases on a stepped virtual motor.

Plants, cars, arms, manoeuvres and the controllers' knowledge are those of the simulated benchmark, drawn from the same
seeds. What lies between is the drive's frames, its wire, state machine and sensors, and the rig's own session; so a
case's two scores tell what that path costs a controller. Scored are the true signals of the virtual wheel, against the
ideal that the simulation's own functions find from them (rig_truth), not what the rig measured. Cogging and unbalance
are off and the safety layer is as wide as it goes: neither is in the simulation. The sensor noise has the same size but
other values; what that alone does to a score is found from simulations (bench_noise).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from scipy.stats import trim_mean

import controllers
import steer_env  # noqa: F401  (registers the ids)
from experiments.bench_cases import SETTLE_S, Case, Maker, number_of, scored_result, task_of
from experiments.bench_gates import gates_of
from experiments.bench_noise import noise_interval, noise_scores
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.bench_run import batches_of, run_cases
from experiments.bench_store import Store
from experiments.bench_systems import SYSTEMS, System
from experiments.rig_truth import true_signals
from experiments.rollout import Episode
from experiments.worker_pool import worker_pool
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.steer_env import COMPLETE
from steer_env.envs.task import Task, prepare
from steer_env.interface import Controller
from steer_env.physics.plant import PlantState
from steer_env.plants import Plant, Reference
from steer_env.rig import motors
from steer_env.rig.safety_limits import Limits
from steer_env.rig.virtual import settings
from steer_env.rig.virtual.wheel import PERFECT

Result = dict[str, Any]
Advance = Callable[..., None]

RIG_SYSTEMS = tuple(system for system in SYSTEMS if system[0] == "SbW")  # what a rig is
# As wide as they may be: a limiter that acts would be scored with the controller; the simulation has none. An episode
# ends early where a simulated one does (RATE_LIMIT, TORQUE_LIMIT), or at a fault of the drive or of the bus.
WIDEST = Limits(
    rate_up=1e5, rate_down=1e5, window_change=50.0, angle_limit=30.0, angle_softening=0.01, speed_limit=100.0,
    speed_softening=0.1, energy_store=500.0, energy_income=50.0, override_torque=60.0, override_time=5.0, jump=1.0,
    motion_mismatch=5.0, torque_mismatch=50.0, frozen_after=9.0, frozen_torque=50.0,
)  # fmt: skip


class Beside(NamedTuple):
    """Scores of one controller and causality in JND (interquartile means), and what the path did meanwhile.

    ``by_noise`` is where the simulated score lies in 95 of 100 times when the sensors' noise alone is drawn anew (low,
    high), ``largest_by_noise`` the widest that a single case's score moves with it. ``limited`` is the share of periods
    in which the safety layer changed a torque, ``tripped`` counts episodes.
    """

    controller: str
    causality: str
    score: float
    simulated_score: float
    by_noise: tuple[float, float]
    largest_difference: float
    largest_by_noise: float
    cases: int
    unstable: int
    simulated_unstable: int
    tripped: int
    limited: float


def rig_cases(
    names: Sequence[str], protocol: Protocol, quick: bool = True, systems: Sequence[System] = RIG_SYSTEMS
) -> list[Case]:
    """The scored cases of controllers that a rig can drive; ``quick``: 75 km/h, the relaxed arm, one draw."""
    cases = [case for name in names for case in protocol.test_cases(name, quick)]
    return [case for case in cases if (case.plant, case.causality) in systems]


class Driven(NamedTuple):
    """Results, reasons against a controller by name, and what goes into scores.json beside them."""

    results: list[Result]
    gates: dict[str, list[str]]
    proof: dict[str, Any]


def rig_benchmark(
    names: Sequence[str],
    reference: Reference,
    motor: str,
    quick: bool = True,
    seed: int = 0,
    jobs: int = 1,
    store: Path | None = None,
    advance: Advance = lambda *_, **__: None,
    makers: Mapping[str, Maker] | None = None,
    systems: Sequence[System] = RIG_SYSTEMS,
) -> Driven:
    """The cases through the CAN path and simulated, and the linear proof of the same loops (of the simulated plant)."""
    protocol, own = Protocol.load(), makers or {}
    cases = rig_cases(names, protocol, quick, systems)
    results = run_on_rig(cases, reference, motor, seed, jobs, store, advance, own)
    simulated = run_cases(cases, reference, seed, jobs, store, advance, own)
    for here, there in zip(results, simulated, strict=True):
        here["rig"]["simulated_score"] = case_score(there, protocol)
    gates, proof = gates_of(names, reference, results, own, quick, jobs, advance, systems)
    rows = [row._asdict() for row in beside(results, simulated, protocol)]
    return Driven(results, gates, {**proof, "rig": {"motor": motor, "beside": rows}})


def run_on_rig(
    cases: Sequence[Case],
    reference: Reference,
    motor: str = "simulated",
    seed: int = 0,
    jobs: int = 1,
    store: Path | None = None,
    advance: Advance = lambda *_, **__: None,
    makers: Mapping[str, Maker] | None = None,
) -> list[Result]:
    """Results in the order of the cases, as ``bench_run.run_cases`` has them, with ``rig``: {ended, limited, noise}.

    ``jobs`` processes; with ``makers`` of your own this one does everything. InputError for an unknown motor.
    """
    motors.make(motor, **settings(motor))
    chosen = makers or {}
    kept = None if store is None else Store(store / motor, reference, seed)
    found: dict[Case, Result] = {}
    waiting = []
    for group in batches_of(cases):
        done = kept.read(group) if kept and group[0].controller not in chosen else None
        if done is None:
            waiting.append(group)
            continue
        found.update(zip(group, done, strict=True))
        advance(len(group), note=f"{group[0].controller} kept")
    for group, results in zip(waiting, _driven(waiting, reference, motor, seed, jobs, chosen), strict=True):
        found.update(zip(group, results, strict=True))
        if kept and group[0].controller not in chosen:
            kept.write(group, results)
        advance(len(group), note=f"{group[0].controller} {group[0].causality}")
    return [found[case] for case in cases]


def _driven(
    groups: Sequence[Sequence[Case]],
    reference: Reference,
    motor: str,
    seed: int,
    jobs: int,
    makers: Mapping[str, Maker],
) -> Iterator[list[Result]]:
    if jobs == 1 or makers or len(groups) < 2:
        yield from (_drive(group, reference, motor, seed, makers) for group in groups)
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in robustness.each_system
    with worker_pool(min(jobs, len(groups))) as pool:
        yield from pool.map(partial(_drive, reference=reference, motor=motor, seed=seed, makers={}), groups)


def _drive(
    group: Sequence[Case], reference: Reference, motor: str, seed: int, makers: Mapping[str, Maker]
) -> list[Result]:
    """One batch; its controller is designed once and reset for every case."""
    first, seeds = group[0], Protocol.load().draw_seeds
    make = makers.get(first.controller) or partial(controllers.make, first.controller)
    known = task_of(first, reference, seeds[first.split]).plant
    assert isinstance(known, Plant)
    controller = make(known.believed(), Reference.load(reference, first.linear), first.causality)
    results = [rig_result(case, reference, motor, seed, controller) for case in group]
    for case, result in zip(group, results, strict=True):
        result["rig"]["noise"] = noise_scores(case, task_of(case, reference, seeds[case.split]), controller, seed)
    return results


def rig_result(case: Case, reference: Reference, motor: str, seed: int, controller: Controller) -> Result:
    """Scores and plot data of one case; a trip counts as unstable, and ``rig`` keeps its reason."""
    task = task_of(case, reference, Protocol.load().draw_seeds[case.split])
    episode, ended, limited = rig_episode(task, controller, motor, (seed, number_of(case.place)))
    return {**scored_result(case, episode), "rig": {"ended": ended, "limited": limited}}


def rig_episode(task: Task, controller: Controller, motor: str, seed: Sequence[int]) -> tuple[Episode, str, float]:
    """(True signals of the virtual wheel, why it ended, share of periods that the safety layer changed)."""
    assert isinstance(task.plant, Plant)
    options = settings(motor)
    cap = min(motors.make(motor, **options).rated_torque, task.plant.motor.rated_torque)
    env: Any = gymnasium.make(
        f"steer_env/Rig-{task.causality.capitalize()}-v0",
        disable_env_checker=True, motor=motor, motor_options=options, limits=WIDEST._replace(torque_cap=cap),
        virtual={
            "plant": task.plant,  # the drawn one: what the control side knows is the nominal plant
            "imperfections": PERFECT,
            "dead_time": task.plant.motor.dead_time * PERIOD,
            "seed": int(np.random.SeedSequence(seed).generate_state(1)[0]),
        },
        rest=SETTLE_S + PERIOD, **{f.name: getattr(task, f.name) for f in fields(task) if f.name != "causality"},
    ).unwrapped  # fmt: skip
    states, commands, limited, ended = [], [], 0, ""
    try:
        env.np_random = np.random.default_rng(seed)
        _, info = env.reset()
        controller.reset(PERIOD)
        while not ended:
            torque = float(controller(info["observation"]))
            if not math.isfinite(torque):
                ended = "the controller gave no finite torque"
                break
            *_, info = env.step(env.action_for(torque))
            ended = info["ended"]
            if not ended:  # the step that ends an episode also brings the drive down: one more than the protocol has
                states.append(env.connection.wheel.state)
                commands.append(info["command"])
                limited += bool(info["rig"]["limited_by"])
    finally:
        env.close()
    setup = prepare(task, np.random.default_rng(seed), PERIOD)
    signals = true_signals(setup, np.array(states).reshape(-1, len(PlantState._fields)), np.array(commands))
    thrown = bool(np.any(signals[:, Truth._fields.index("unstable")] > 0.5))
    return Episode(setup, signals, ended == COMPLETE and not thrown), ended, limited / max(len(commands), 1)


def beside(results: Sequence[Result], simulated: Sequence[Result], protocol: Protocol) -> list[Beside]:
    """One row per controller and causality; the two lists hold the same cases in the same order."""
    pairs: dict[tuple[str, str], list[tuple[Result, Result]]] = {}
    for here, there in zip(results, simulated, strict=True):
        case = here["case"]
        pairs.setdefault((case["controller"], case["causality"]), []).append((here, there))
    rows = []
    for where, both in pairs.items():
        scores = np.array([[case_score(result, protocol) for result in pair] for pair in both])
        means = trim_mean(scores, 0.25, axis=0)
        drawn = np.array([[case_score(there, protocol), *here["rig"]["noise"]] for here, there in both])
        rows.append(
            Beside(
                *where,
                float(means[0]),
                float(means[1]),
                noise_interval(drawn),
                float(np.abs(scores[:, 0] - scores[:, 1]).max()),
                float(np.ptp(drawn, axis=1).max()),
                len(both),
                sum(not here["stable"] for here, _ in both),
                sum(not there["stable"] for _, there in both),
                sum(here["rig"]["ended"].startswith("tripped") for here, _ in both),
                float(np.mean([here["rig"]["limited"] for here, _ in both])),
            )
        )
    return rows


def beside_table(rows: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[object]]]:
    """Columns and rows of ``beside`` on stdout."""
    columns = ["controller", "causality", "JND", "simulated", "other noise", "unstable", "simulated", "tripped"]
    return [*columns, "limited"], [
        [row["controller"], row["causality"], f"{row['score']:.2f}", f"{row['simulated_score']:.2f}",
         "{:.2f} to {:.2f}".format(*row["by_noise"]), f"{row['unstable']} of {row['cases']}",
         row["simulated_unstable"], row["tripped"], f"{100.0 * row['limited']:.1f} %"]
        for row in rows
    ]  # fmt: skip
