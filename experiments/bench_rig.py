"""The benchmark through the CAN path: the protocol's steer-by-wire cases on a stepped virtual motor.

Plants, cars, arms, manoeuvres and the controllers' knowledge are those of the simulated benchmark, drawn from the same
seeds. What lies between is the drive's frames, its wire, state machine and sensors, and the rig's own session; so a
case's two scores tell what that path costs a controller. Scored are the true signals of the virtual wheel, against the
ideal that the simulation's own functions find from them, not what the rig measured. Cogging and unbalance are off and
the safety layer is as wide as it goes: neither is in the simulation. The sensor noise has the same size but other values.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from scipy.stats import trim_mean

import controllers
import steer_env  # noqa: F401  (registers the ids)
from experiments.bench_cases import SETTLE_S, Case, Maker, number_of, scored_result, task_of
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import case_score
from experiments.bench_run import batches_of
from experiments.bench_store import Store
from experiments.rollout import Array, Episode
from steer_env.envs import batch
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Truth
from steer_env.envs.parts import judged, truth_of
from steer_env.envs.steer_env import COMPLETE
from steer_env.envs.task import Setup, Task, prepare
from steer_env.interface import Controller
from steer_env.manoeuvres import hand_at
from steer_env.physics import vehicle
from steer_env.physics._jit import compiled
from steer_env.physics.plant import PlantState, motion_of
from steer_env.physics.reference import ReferenceState, single_track_of
from steer_env.physics.steering import torsion_bar_torque
from steer_env.physics.vehicle import SingleTrackState
from steer_env.plants import Plant, Reference
from steer_env.rig import motors
from steer_env.rig.safety_limits import Limits
from steer_env.rig.virtual import settings
from steer_env.rig.virtual.wheel import PERFECT

Result = dict[str, Any]
Advance = Callable[..., None]

PLANT = "SbW"  # what a rig is
# As wide as they may be: a limiter that acts would be scored with the controller, and the simulation has none. What ends
# an episode is what ends a simulated one (RATE_LIMIT, TORQUE_LIMIT), a fault of the drive or of the bus.
WIDEST = Limits(
    rate_up=1e5, rate_down=1e5, window_change=50.0, angle_limit=30.0, angle_softening=0.01, speed_limit=100.0,
    speed_softening=0.1, energy_store=500.0, energy_income=50.0, override_torque=60.0, override_time=5.0, jump=1.0,
    motion_mismatch=5.0, torque_mismatch=50.0, frozen_after=9.0, frozen_torque=50.0,
)  # fmt: skip

_steering, _motor = PARAMETERS.loader("steering"), PARAMETERS.loader("motor")
_driver, _manoeuvre = PARAMETERS.loader("driver"), PARAMETERS.loader("manoeuvre")
_episode, _reward = PARAMETERS.loader("episode"), PARAMETERS.loader("reward")
_load_reference, _load_track, _load_car = STATE.loader("reference"), STATE.loader("track"), STATE.loader("car")


class Beside(NamedTuple):
    """Scores of one controller and causality in JND (interquartile means), and what the path did meanwhile.

    ``limited`` is the share of periods in which the safety layer changed a torque, ``tripped`` counts episodes.
    """

    controller: str
    causality: str
    score: float
    simulated_score: float
    largest_difference: float
    cases: int
    unstable: int
    simulated_unstable: int
    tripped: int
    limited: float


def rig_cases(names: Sequence[str], protocol: Protocol, quick: bool = True) -> list[Case]:
    """The scored cases of controllers that a rig can drive; ``quick``: 75 km/h, the relaxed arm, one draw."""
    return [case for name in names for case in protocol.test_cases(name, quick) if case.plant == PLANT]


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
    """Results in the order of the cases, as ``bench_run.run_cases`` has them, with ``rig``: {ended, limited}.

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
    groups: Sequence[Sequence[Case]], reference: Reference, motor: str, seed: int, jobs: int, makers: Mapping[str, Maker]
) -> Iterator[list[Result]]:
    if jobs == 1 or makers or len(groups) < 2:
        yield from (_drive(group, reference, motor, seed, makers) for group in groups)
        return
    # As in robustness.each_system: no threads inside the processes, and none forked from a parent with threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with ProcessPoolExecutor(min(jobs, len(groups)), mp_context=get_context("spawn")) as pool:
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
    return [rig_result(case, reference, motor, seed, controller) for case in group]


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
        rest=SETTLE_S, **{f.name: getattr(task, f.name) for f in fields(task) if f.name != "causality"},
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
            states.append(env.connection.wheel.state)
            commands.append(info["command"])
            limited += bool(info["rig"]["limited_by"])
            ended = info["ended"]
    finally:
        env.close()
    setup = prepare(task, np.random.default_rng(seed), PERIOD)
    signals = true_signals(setup, np.array(states).reshape(-1, len(PlantState._fields)), np.array(commands))
    thrown = bool(np.any(signals[:, Truth._fields.index("unstable")] > 0.5))
    return Episode(setup, signals, ended == COMPLETE and not thrown), ended, limited / max(len(commands), 1)


def true_signals(setup: Setup, states: Array, commands: Array) -> Array:
    """Truth [n, fields] from the virtual wheel's states [n, fields of PlantState] and the commands [n] in N m.

    By the simulation's own functions, ideal reference included; the car follows the true pinion angle.
    """
    parameters, rows, lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, rows, lines, setup.table, setup.car_table)
    signals = np.zeros((len(states), len(Truth._fields)))
    _judge(states, commands, parameters[0], rows[0], signals)
    return signals


@compiled
def _judge(states: Array, commands: Array, p_row: Array, s_row: Array, signals: Array) -> None:
    steering, motor, driver, manoeuvre = _steering(p_row), _motor(p_row), _driver(p_row), _manoeuvre(p_row)
    episode, weights = _episode(p_row), _reward(p_row)
    reference, columns, car = _load_reference(s_row), _load_track(s_row), _load_car(s_row)
    body, speed = single_track_of(car), episode.speed
    track = SingleTrackState(0.0, 0.0, 0.0, 0.0)
    judge = ReferenceState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    before, last = 0.0, 0.0
    for k in range(states.shape[0]):
        s = states[k]
        now = s[2] * (1.0 / car.i_s)
        track = vehicle.single_track_step(track, before, 0.5 * (before + now), now, speed, body, PERIOD)
        before = now
        x = PlantState(
            s[0], s[1], s[2], s[3], track.lateral_speed, track.yaw_rate, track.slip_front, track.slip_rear,
            s[8], s[9], s[10], s[11], s[12],
        )  # fmt: skip
        hand = hand_at(episode.kind, (k + 0.5) * PERIOD, manoeuvre)
        M_tb = torsion_bar_torque(motion_of(x), steering)
        ideal, error, cost, judge = judged(
            x, M_tb, hand, speed, judge, episode, weights, steering, driver, reference, columns, car, None
        )
        verdict = ideal, error, cost
        truth = truth_of(
            k, x, M_tb, commands[k], last, verdict, hand, speed, episode.rack_share, motor, weights, driver, car, None
        )
        last = commands[k]
        for j in range(len(truth)):
            signals[k, j] = truth[j]


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
        rows.append(
            Beside(
                *where,
                float(means[0]),
                float(means[1]),
                float(np.abs(scores[:, 0] - scores[:, 1]).max()),
                len(both),
                sum(not here["stable"] for here, _ in both),
                sum(not there["stable"] for _, there in both),
                sum(here["rig"]["ended"].startswith("tripped") for here, _ in both),
                float(np.mean([here["rig"]["limited"] for here, _ in both])),
            )
        )
    return rows
