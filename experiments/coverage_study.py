"""Do the 95 % intervals hold? Many seeds, one table: bias, spread, promised error, and how often the truth is inside.

Two cars: one that is exactly the model (only noise is left: the test of the standard errors), and the virtual test
vehicle, which rolls, saturates and compensates (noise and model error together: the test of the workflow).

    python -m experiments.coverage_study [--seeds 50] [--car conforming|virtual|both]
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import click
import numpy as np

from experiments.cli_options import print_table, progress
from experiments.conforming_car import Truth, campaign, clean_runs
from identification.campaign import Campaign, Run
from identification.campaign_toml import KnownSteering
from identification.identify import Options, identify
from identification.refine import equivalent_gain
from identification.steady_state import on_centre_stiffness
from steer_env.physics.reference import ReferenceParameters
from steer_env.plants.reference_file import ROW_KEYS
from steer_env.plants.reference_row import KnownVehicle
from steer_env.testcar.drive import drive, generator_of
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun, runs_at
from steer_env.testcar.truth import truth_at
from steer_env.units import from_kmh

KEYS = ("C_f", "C_r", "n_t", "J_z", "sigma_f", "sigma_r", "J_ref", "b_ref", "k_gain", "c_pin_on", "c_pin_off",
        "sigma_assist", "M_fric_C", "c_fric")  # fmt: skip
SPEEDS_KMH = (45.0, 75.0, 105.0)
QUANTILE = 1.96
Plans = dict[float, list[PlannedRun]]
Known = dict[float, dict[str, float]]


class Line(NamedTuple):
    """What the seeds say of one parameter at one speed; relative to the truth, except coverage (0 to 1)."""

    name: str
    speed_kmh: float
    truth: float
    bias: float
    spread: float
    promised: float
    coverage: float


def conforming_truths(speeds_kmh: tuple[float, ...] = SPEEDS_KMH) -> list[Truth]:
    """Ordinary values, not those of any start or bound."""
    made = []
    for speed_kmh in speeds_kmh:
        p = ReferenceParameters(
            J_ref=0.060, b_ref=0.74, M_fric_C=2.3, c_fric=200.0, r=0.25, sigma=1.7, relaxed=1.0, J_z=3000.0,
            C_f=121e3, C_r=148e3, sigma_f=0.33, sigma_r=0.41, n_t=0.083,
        )  # fmt: skip
        speed = from_kmh(speed_kmh)
        made.append(Truth(speed, p, 3.2 * p.i_s * (2.776 + 0.003 * speed * speed) / (speed * speed)))
    return made


def study_conforming(seeds: range, speeds_kmh: tuple[float, ...] = SPEEDS_KMH, quiet: bool = True) -> list[Line]:
    """The table for the conforming car."""
    cars = [(truth, clean_runs(truth)) for truth in conforming_truths(speeds_kmh)]
    known = {}
    for speed_kmh, (truth, clean) in zip(speeds_kmh, cars, strict=True):
        p = truth.parameters
        values = {k: getattr(p, k) for k in ("C_f", "C_r", "n_t", "J_z", "sigma_f", "sigma_r", "J_ref", "b_ref")}
        vehicle = KnownVehicle(p.m, p.l_f, p.l_r, p.J_z, p.i_s, 118.0)
        swept = np.concatenate([r[:, 3] for manoeuvre, r in clean if manoeuvre == "frequency_response"])
        c_pin_on = on_centre_stiffness(values, truth.speed, vehicle)
        known[speed_kmh] = {
            **values, "k_gain": equivalent_gain(swept, p.r, p.sigma), "c_pin_on": c_pin_on,
            "c_pin_off": p.r * c_pin_on, "sigma_assist": p.sigma, "M_fric_C": p.M_fric_C, "c_fric": p.c_fric,
        }  # fmt: skip
    made = (campaign(cars, np.random.default_rng(seed)) for seed in seeds)
    return table(made, known, len(seeds), quiet)


def study_virtual(
    seeds: range, speeds_kmh: tuple[float, ...] = SPEEDS_KMH, quiet: bool = True
) -> list[Line]:
    """The table for the virtual test vehicle, driven anew with each seed."""
    plans = plans_virtual(speeds_kmh)
    made = (virtual_campaign(plans, seed) for seed in seeds)
    return table(made, known_virtual(plans), len(seeds), quiet)


def plans_virtual(speeds_kmh: tuple[float, ...]) -> Plans:
    """Two sweeps and all sines at each speed in km/h."""
    wanted = ("frequency_response", "steady_state")
    return {v: [r for r in runs_at(v, 2, VirtualCar()) if r.manoeuvre in wanted] for v in speeds_kmh}


def known_virtual(plans: Plans) -> Known:
    """The derived truth of the virtual test vehicle at the planned amplitudes."""
    known: Known = {}
    for v, plan in plans.items():
        size = {run.manoeuvre: run.amplitude for run in plan}
        row = truth_at(v, size["steady_state"], size["frequency_response"], VirtualCar())
        known[v] = {name: float(row[ROW_KEYS[name]]) for name in KEYS}  # type: ignore[arg-type]
    return known


def virtual_campaign(plans: Plans, seed: int) -> Campaign:
    """The planned runs, driven and logged, as a campaign; all are for identification."""
    car, runs = VirtualCar(), []
    for run in (run for plan in plans.values() for run in plan):
        logged = drive(run, car, generator_of(run, seed))
        columns = {name: np.asarray(values, dtype=np.float64) for name, values in logged.items()}
        time = columns.pop("time_s")
        speed = from_kmh(run.speed_kmh)
        runs.append(Run(run.name, run.manoeuvre, speed, "identify", time, 0.01, columns))
    v, s = car.vehicle, car.steering
    vehicle = KnownVehicle(v.m, v.l_f, v.l_r, v.J_z, v.i_s, car.i_rp)
    steering = KnownSteering(s.J_s, car.robot.J, s.b_s, s.c_tb, s.b_tb)
    return Campaign("virtual", "vehicle", vehicle, steering, None, runs, {}, Path("memory"))


def table(campaigns: Iterable[Campaign], known: Known, count: int, quiet: bool) -> list[Line]:
    """Identify each campaign per speed and compare with ``known`` (speed in km/h -> name -> truth)."""
    found = defaultdict(list)
    with progress("coverage", total=count, quiet=quiet) as advance:
        for made in campaigns:
            for result in identify(made, Options(("per-speed",)), jobs=2).modes["per-speed"]:
                speed = min(known, key=lambda v: abs(v - result.speed_kmh))
                for name in KEYS:
                    if name in result.std and math.isfinite(result.std[name]):
                        found[name, speed].append((result.values[name], result.std[name]))
            advance()
    lines = []
    for (name, speed), pairs in sorted(found.items(), key=lambda item: (KEYS.index(item[0][0]), item[0][1])):
        value, error = np.array(pairs).T
        truth = known[speed][name]
        inside = np.abs(value - truth) <= QUANTILE * error
        bias, size = float(value.mean()) / truth - 1.0, abs(truth)
        share = float(inside.mean())
        lines.append(Line(name, speed, truth, bias, float(value.std()) / size, float(error.mean()) / size, share))
    return lines


def overall(lines: list[Line]) -> float:
    """Share of all intervals that hold their truth."""
    return float(np.mean([line.coverage for line in lines]))


@click.command()
@click.option("--seeds", default=50, show_default=True, type=click.IntRange(2, 1000))
@click.option("--car", type=click.Choice(["conforming", "virtual", "both"]), default="both", show_default=True)
def main(seeds: int, car: str) -> None:
    """Print coverage, bias and spread of every identified parameter over many seeds."""
    studies = {"conforming": study_conforming, "virtual": study_virtual}
    for name in studies if car == "both" else (car,):
        lines = studies[name](range(seeds), quiet=False)
        rows = [
            [x.name, f"{x.speed_kmh:g}", x.truth, f"{100 * x.bias:+.2f}", f"{100 * x.spread:.2f}",
             f"{100 * x.promised:.2f}", f"{100 * x.coverage:.0f}"]
            for x in lines
        ]  # fmt: skip
        columns = ("parameter", "km/h", "truth", "bias %", "spread %", "promised %", "coverage %")
        print_table(columns, rows, title=f"{name} car, {seeds} seeds; all intervals: {100 * overall(lines):.1f} %")


if __name__ == "__main__":
    main()
