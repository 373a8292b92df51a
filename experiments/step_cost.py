"""What one step of each control law costs on this machine, beside the control period.

    python -m experiments.step_cost [--plant EPAS] [--steps 20000] [--json]

(the benchmark has median and 99.9th percentile, from shorter episodes, in its report).

The observations are those of a closed-loop chirp with the law itself, replayed PASSES times, compiled
and in Python. Compiled, the clock is read after every step, through the interpreter: the row
"nothing" is what the loop and its clock take without a law, and is in every single time; nothing is
subtracted. The mean alone comes from passes that read the clock at their ends. A step's own time is
the least of its passes, for the same work is done in each; "as it came" is every pass, with
whatever else the machine did meanwhile.

The shipped plants' motors seldom meet a limit. What mpc costs where one acts is measured with a motor
that changes its torque at SLOW of the plant's slew rate, over the steps in which the programme had to
be solved.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import product

import click
import numpy as np
from rich.console import Console
from rich.table import Table

import controllers
from controllers.law import LawController
from experiments.bench_cases import Maker
from experiments.bench_systems import SYSTEMS, System
from experiments.step_times import Array, compiled_passes, nothing, python_pass, recorded
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.interface import Observation
from steer_env.plants import PLANTS, Plant, Reference

PASSES = 3
REPORTED_STEPS = 3000  # of an episode for the benchmark's report, which has little time for it
SLOW = 0.03
LIMITED = "mpc, a limit acting"


@dataclass(frozen=True)
class Cost:
    """Microseconds per step of one law: its own (mean, median, 99.9th percentile), and as they came."""

    controller: str
    causality: str
    steps: int
    mean_us: float
    p50_us: float
    p999_us: float
    p999_as_it_came_us: float
    python_p50_us: float
    python_p999_us: float
    python_p999_as_it_came_us: float


def cost_of(name: str, controller: LawController, causality: str, rows: Array, limited_alone: bool = False) -> Cost:
    """The cost of a controller over observations [n, fields], or of the steps alone in which a limit of mpc acted.

    Compiled and Python torques must agree to the last bit, or something else was timed.
    """
    python = [python_pass(controller, rows) for _ in range(PASSES)]
    controller.reset(PERIOD)
    means, times, torques = compiled_passes(controller.law, controller.state(), controller.parameters, rows, PASSES)
    assert np.array_equal(torques, python[0][1]), f"{name}: compiled and Python torques differ"
    python_times = np.array([taken for taken, _, _ in python])
    mean = float(means.min())
    if limited_alone:
        acting = python[0][2]
        times, python_times = times[:, acting], python_times[:, acting]
        mean = float(times.min(axis=0).mean())
    return summary(name, causality, mean, times, python_times)


def summary(name: str, causality: str, mean: float, times: Array, python_times: Array) -> Cost:
    """A Cost out of a mean in ns and times [passes, n] in ns, compiled and in Python."""
    figures = [mean]
    for taken in (times, python_times):
        own = taken.min(axis=0)
        figures += [*np.quantile(own, (0.5, 0.999)), np.quantile(taken, 0.999)]
    return Cost(name, causality, times.shape[1], *(float(figure) / 1e3 for figure in figures))


def costs(plant: Plant, steps: int, names: tuple[str, ...] = tuple(controllers.CONTROLLERS)) -> list[Cost]:
    """Nothing, the named controllers in both causalities, and mpc with its limits acting."""
    rows = np.zeros((steps, len(Observation._fields)))
    found = [cost_of("nothing", LawController(nothing, lambda period: 0.0, 0.0), "", rows)]
    reference = Reference.load("published")
    slow = replace(plant, motor=plant.motor._replace(slew_rate=SLOW * plant.motor.slew_rate))
    for causality in controllers.CAUSALITIES:
        for name, label, driven in [*((name, name, plant) for name in names), ("mpc", LIMITED, slow)]:
            # As designed where the limits act: what a solution costs does not depend on how gains were tuned.
            controller = controllers.make(name, driven, reference, causality, tuned=label != LIMITED)
            assert isinstance(controller, LawController)
            rows = recorded(Task(driven, causality, reference, driver="tense"), controller, steps)
            found.append(cost_of(label, controller, causality, rows, label == LIMITED))
    return found


def reported(
    names: Sequence[str],
    reference: Reference,
    makers: Mapping[str, Maker] | None = None,
    systems: Sequence[System] = SYSTEMS,
) -> dict[str, dict[str, float]]:
    """Median and 99.9th percentile in microseconds, compiled, of the slower causality of each controller.

    On the plant of the first of the systems, in the causalities that they have of it.

    ``makers`` stand in for controllers by name. Those without a pure law cannot run compiled and are left out.
    """
    found: dict[str, dict[str, float]] = {}
    plant = systems[0][0]
    for name, causality in product(names, [causality for where, causality in systems if where == plant]):
        make = (makers or {}).get(name) or partial(controllers.make, name)
        controller = make(PLANTS[plant], reference, causality)
        if not hasattr(controller, "law"):
            continue
        rows = recorded(Task(plant, causality, reference, driver="tense"), controller, REPORTED_STEPS)
        controller.reset(PERIOD)
        _, times, _ = compiled_passes(controller.law, controller.state(), controller.parameters, rows, PASSES)
        p50, p999 = (float(ns) / 1e3 for ns in np.quantile(times.min(axis=0), (0.5, 0.999)))
        if name not in found or p50 > found[name]["p50_us"]:
            found[name] = {"p50_us": p50, "p999_us": p999}
    return found


def table_of(found: list[Cost], plant: str) -> Table:
    """The costs in microseconds."""
    title = f"one step of a control law on {plant} in us; the control period is {1e6 * PERIOD:.0f} us"
    table = Table("controller", "causality", title=title)
    headings = ("mean", "median", "99.9 %", "as it came", "Python median", "99.9 %", "as it came")
    for heading in ("steps", *headings):
        table.add_column(heading, justify="right")
    for c in found:
        compiled = (c.mean_us, c.p50_us, c.p999_us, c.p999_as_it_came_us)
        python = (c.python_p50_us, c.python_p999_us, c.python_p999_as_it_came_us)
        cells = [f"{value:.2f}" for value in compiled] + [f"{value:.1f}" for value in python]
        table.add_row(c.controller, c.causality, f"{c.steps}", *cells)
    return table


@click.command()
@click.option("--plant", default="EPAS", show_default=True, type=click.Choice(list(PLANTS)))
@click.option("--steps", default=20_000, show_default=True, type=click.IntRange(100), help="Periods of each episode.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
def main(plant: str, steps: int, as_json: bool) -> None:
    """Print the cost of one step of every controller."""
    found = costs(PLANTS[plant], steps)
    if as_json:
        machine = {"machine": platform.machine(), "system": platform.system(), "python": platform.python_version()}
        rows = [asdict(cost) for cost in found]
        click.echo(json.dumps({"plant": plant, "period_us": 1e6 * PERIOD, **machine, "costs": rows}))
    else:
        Console(width=140).print(table_of(found, plant))


if __name__ == "__main__":
    main()
