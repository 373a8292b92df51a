"""What one second of one core buys: python -m experiments.uses_of_speed [--repeats 3].

Training is not what the compiled equations are for alone: scoring and tuning of controllers, the virtual test car,
identification and the gap workflow run on the same ones. Every use is measured through the functions that its command
calls, in seconds of driving that are simulated in one second of the processor, on one thread; then once more in a
process in which nothing is compiled (NUMBA_DISABLE_JIT=1), on the same inputs.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import click
from rich.console import Console
from rich.table import Table

import controllers
from experiments import bench_cases
from experiments.bench_protocol import Protocol
from experiments.rollout import scored
from experiments.simulate import Order, simulate
from experiments.tune import DRAWS, SPEEDS_KMH, objective
from identification.campaign import Campaign, read_campaign
from identification.forward import ForwardMisfit
from identification.gap.vehicle_model import vehicle_model
from identification.vehicle_bounds import START
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.physics._jit import COMPILED
from steer_env.plants import PLANTS, Reference
from steer_env.testcar.drive import drive
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun
from steer_env.units import from_kmh

PLANT, CAUSALITY, LAW = "EPAS", "impedance", "pid"
SPEED_KMH = 60.0
EPISODES, EPISODE_S = 64 if COMPILED else 2, 3.0
LEAST_S = 0.5  # of the processor that one measurement takes
REFERENCE = {"J_ref": 0.06, "b_ref": 0.7, "r": 0.2, "sigma_assist": 1.8, "M_fric_C": 2.0, "c_fric": 200.0}

Use = Callable[[], float]
"""Does its work once and returns how many seconds of driving that simulated."""


def uses(campaign: Campaign) -> dict[str, Use]:
    """Every use by what a reader knows it as; ``campaign`` was driven at SPEED_KMH."""
    reference = Reference.load("published")
    law = controllers.make(LAW, PLANTS[PLANT], reference, CAUSALITY)
    task = Task(PLANT, CAUSALITY, reference, speed_kmh=SPEED_KMH, duration=EPISODE_S)
    protocol = Protocol.load()
    case = protocol.training_cases(LAW, PLANT, CAUSALITY, SPEEDS_KMH, 1)[0]
    (sine,) = campaign.select("steady_state")[SPEED_KMH][:1]
    speed = from_kmh(SPEED_KMH)
    assert campaign.vehicle is not None, "a vehicle campaign has these"
    assert campaign.steering is not None
    bar = (campaign.steering.torsion_bar_stiffness, campaign.steering.torsion_bar_damping)
    misfit = ForwardMisfit([sine], speed, campaign.vehicle, "relaxed", bar)
    identified = {**START, "J_z": campaign.vehicle.yaw_inertia, **REFERENCE}
    (inputs,) = misfit.inputs(identified)
    model = vehicle_model(campaign)
    record = next(record for record in model.records if record.manoeuvre == "steady_state")
    nominal = {unknown.name: unknown.start for unknown in model.unknowns}
    planned = PlannedRun(SPEED_KMH, "steady_state", 1, 0.5)

    def episodes() -> float:
        return PERIOD * float(scored(task, law, range(EPISODES))[:, 0].sum())

    def benchmark() -> float:
        episode = bench_cases.episode_of(case, reference, 0, protocol.draw_seeds["training"])
        bench_cases.scored_result(case, episode)
        return PERIOD * len(episode.signals)

    def car() -> float:
        return float(drive(planned, VirtualCar(), None)["time_s"][-1])

    def identification() -> float:
        return sine.dt * misfit.simulate(inputs, sine.dt, identified).size

    fresh = count(1)  # a motion that is known already is not simulated again

    def gap() -> float:
        values = {**nominal, "C_f": nominal["C_f"] * (1.0 + 1e-6 * next(fresh))}
        return record.dt * next(iter(model.simulate(record, values, {}).values())).size

    return {
        "episodes under a controller, with noise": episodes,
        "a benchmark case with all its metrics": benchmark,
        "the virtual test car and its logger": car,
        "identification: torque simulated forward": identification,
        "gap: all channels of a run predicted": gap,
    }


def rates(campaign: Campaign, repeats: int) -> dict[str, float]:
    """Simulated seconds in a second of the processor, the median of ``repeats``."""
    found = {}
    for name, use in uses(campaign).items():
        if COMPILED:
            use()  # compiles
        taken = []
        for _ in range(repeats):
            start, driven = time.process_time(), 0.0
            while time.process_time() - start < LEAST_S:
                driven += use()
            taken.append(driven / (time.process_time() - start))
        found[name] = median(taken)
    return found


def in_plain_python(campaign: Path) -> dict[str, float]:
    """The same from a process in which nothing is compiled."""
    command = [sys.executable, "-m", "experiments.uses_of_speed", "--campaign", str(campaign), "--repeats", "1"]
    where = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=where, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def trial_seconds() -> tuple[float, int]:
    """(Seconds of one trial of ``steer-env tune``: its cases and its proof; how many cases)."""
    reference = Reference.load("published")
    cases = len(Protocol.load().training_cases(LAW, PLANT, CAUSALITY, SPEEDS_KMH, DRAWS))
    objective(LAW, PLANT, CAUSALITY, {}, reference, 0)
    start = time.process_time()
    objective(LAW, PLANT, CAUSALITY, {}, reference, 0)
    return time.process_time() - start, cases


@click.command()
@click.option("--repeats", default=3, show_default=True, type=click.IntRange(1), help="How often each use is measured.")
@click.option("--campaign", type=click.Path(path_type=Path), help="Print the rates on this campaign alone, as JSON.")
def main(repeats: int, campaign: Path | None) -> None:
    """Print simulated seconds in a second of one core, compiled and in plain Python."""
    if campaign is not None:
        click.echo(json.dumps(rates(read_campaign(campaign), repeats)))
        return
    with TemporaryDirectory() as folder:
        order = Order((SPEED_KMH,), 1, 0, False)
        simulate(order, VirtualCar(), Path(folder), 1, lambda *_, **__: None)
        compiled = rates(read_campaign(folder), repeats)
        plain = in_plain_python(Path(folder))
    table = Table("use", title="seconds of driving in one second of one core")
    for heading in ("compiled", "plain Python", "ratio"):
        table.add_column(heading, justify="right")
    for name, rate in compiled.items():
        table.add_row(name, f"{rate:,.0f}", f"{plain[name]:.3g}", f"{rate / plain[name]:,.0f}")
    console = Console(width=120)
    console.print(table)
    seconds, cases = trial_seconds()
    console.print(f"one trial of steer-env tune ({LAW}): {cases} cases and the proof over all arms in {seconds:.2f} s")


if __name__ == "__main__":
    main()
