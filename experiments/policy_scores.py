"""Learned policies and classical laws on plants, cars and arms that nobody was trained or tuned on, one system alone.

    python -m experiments.policy_scores SbW-Impedance policy:runs/0 policy:runs/1 policy:runs/2 pid lqg [--draws 3]

The benchmark's own test cases, scores, bootstrap intervals and gates, and each policy's distance to each of the others
on the same cases, in tables: ``steer-env benchmark --controller policy:runs/0`` has all else (exhibits, margins,
Z-width, cost) in a report. ``--shake`` tells what no gate asks: commands up to 6 ms later than the controller was told,
and torque sensors with a wrong gain or an offset, in simulation over all arms. Friction and limits catch many an
unstable loop in a limit cycle before the wheel is thrown out, so what still swings after seconds of rest counts too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.signal import detrend

import controllers
from controllers.policy_file import is_policy
from experiments.bench_gates import unstable_episodes
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import standings
from experiments.bench_run import run_cases
from experiments.cli_options import progress
from experiments.paired import differences
from experiments.periodic_loop import unstable_places
from experiments.rollout import Episode, run
from experiments.train import config_of
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

FAULTS = {"torque gain 0.8": (0.8, 0.0), "torque gain 1.2": (1.2, 0.0), "torque offset 0.3 N m": (1.0, 0.3)}
LATE_MS = (0, 1, 2, 3, 4, 5, 6)
SHAKEN_KMH = (45.0, 105.0)
# s of rest after the manoeuvre; noise alone leaves up to 0.6 N m with the nominal plant, a limit cycle several.
REST_S, LEFT_NM = 3.0, 1.0


def scored(names: Sequence[str], plant: str, causality: str, draws: int, seed: int) -> list[Table]:
    """Ranks, scores with intervals, unstable episodes and places, on the first ``draws`` plants of each place.

    Where policies stand among the names, also their paired differences to those that are none.
    """
    protocol, reference = Protocol.load(), Reference.load("published")
    cases = [
        case for name in names for case in protocol.test_cases(name)
        if (case.plant, case.causality) == (plant, causality) and case.draw < draws
    ]  # fmt: skip
    with progress("test cases", total=len(cases)) as advance:
        results = run_cases(cases, reference, seed, advance=advance)
    speeds = [row.speed_kmh for row in reference.file.rows]
    gates = {
        name: [*unstable_places(partial(controllers.make, name), plant, causality, reference, speeds),
               *unstable_episodes(name, results, set())]
        for name in names
    }  # fmt: skip
    table = Table("rank", "controller", "JND", "95 %", "unstable episodes", "unstable places")
    for row in standings(results, protocol, gates, seed):
        low, high = row.score_interval
        places = len(gates[row.controller]) - row.unstable
        table.add_row(
            str(row.rank), row.controller, f"{row.score:.3f}", f"{low:.3f} to {high:.3f}",
            f"{row.unstable} of {row.cases}", str(max(places, 0)),
        )  # fmt: skip
    pairs = [(name, rival) for name in names if is_policy(name) for rival in names if not is_policy(rival)]
    if not pairs:
        return [table]
    title = "the same cases, policy minus the other: below 0 the policy is closer to the reference"
    against = Table("policy", "minus", "JND", "95 %", "closer in", title=title)
    for found in differences(results, pairs, protocol, seed):
        low, high = found.interval
        against.add_row(
            found.controller, found.rival, f"{found.score:+.3f}", f"{low:+.3f} to {high:+.3f}",
            f"{100.0 * found.share:.0f} % of {found.cases}",
        )  # fmt: skip
    return [table, against]


def shaken(names: Sequence[str], plant: str, causality: str) -> Table:
    """Loops that do not come to rest under late commands and wrong sensors, of all arms at SHAKEN_KMH."""
    nominal = PLANTS[plant]
    title = (
        f"loops of {len(DRIVERS) * len(SHAKEN_KMH)} that are thrown out or left swinging by {LEFT_NM:g} N m at the "
        f"torsion bar after {REST_S:g} s of rest; in brackets the largest swing in N m"
    )
    table = Table("controller", *(f"{ms} ms late" for ms in LATE_MS), *FAULTS, title=title)
    for name in names:
        cells = []
        for ms in LATE_MS:
            motor = nominal.motor._replace(dead_time=nominal.motor.dead_time + ms)
            cells.append(_unstable(name, replace(nominal, motor=motor, nominal=nominal), causality))
        for gain, offset in FAULTS.values():
            sensors = nominal.sensors._replace(torque_gain=gain, torque_offset=offset)
            cells.append(_unstable(name, replace(nominal, sensors=sensors, nominal=nominal), causality))
        table.add_row(name, *cells)
    return table


def _unstable(name: str, hardware: Plant, causality: str) -> str:
    """Count and largest swing of one controller on one hardware; nan: the wheel was thrown out."""
    reference = Reference.load("published")
    controller: Any = controllers.make(name, hardware.believed(), reference, causality)
    swings = []
    for (arm, driver), speed in product(DRIVERS.items(), SHAKEN_KMH):
        manoeuvre = "random_torque" if driver.k == 0.0 else "on_centre_weave"
        task = Task(hardware, causality, reference, False, None, manoeuvre, speed, arm, duration=4.0)
        swings.append(swing_left(run(task, controller, seed=1, settle=REST_S)))
    count = sum(not swing < LEFT_NM for swing in swings)
    return f"{count} ({max(swings, key=lambda swing: (math.isnan(swing), swing)):.1f})"


def swing_left(episode: Episode) -> float:
    """Peak to peak in N m of the torsion bar's torque in the last second, without its drift; nan where thrown out."""
    if not episode.stable:
        return math.nan
    torque = episode["torsion_bar_torque"][-round(1.0 / PERIOD) :]
    return float(np.ptp(detrend(torque)))


@click.command()
@click.argument("task")
@click.argument("names", nargs=-1, required=True)
@click.option("--draws", default=3, show_default=True, type=click.IntRange(1, 3), help="Plants per place.")
@click.option("--shake", is_flag=True, help="Late commands and wrong sensors instead of scores.")
@click.option("--seed", default=0, show_default=True)
def main(task: str, names: tuple[str, ...], draws: int, shake: bool, seed: int) -> None:
    """Print the standings of controllers NAMES on TASK."""
    config = config_of(task, 0, {})
    where = config.plant, config.causality
    tables = [shaken(names, *where)] if shake else scored(names, *where, draws, seed)
    Console(width=150).print(*tables)


if __name__ == "__main__":
    main()
