"""Score, judge and rank controllers: steer-env benchmark.

Scored are the test cases of the protocol (benchmark_v1.json); beside them stand exhibits on the
nominal plant (the paper's Figures 9 to 11) that are drawn but not scored. Every case is one compiled
episode whose plant and noise follow from seeds and the case's name: the same bits whatever --jobs.
With --env rig the steer-by-wire cases go through the CAN path (experiments.bench_rig).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

import controllers
from experiments import bench_cases, bench_rig
from experiments.bench_cases import Case, Maker
from experiments.bench_gates import gates_of
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import Standing
from experiments.bench_run import run_cases
from experiments.bench_scores import ranking_table, write_scores
from experiments.bench_systems import SYSTEMS, System, policies_of, ranked, reasons_of, system_of, words_of
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.limit import as_records, limits
from experiments.robustness import QUICK_KMH
from experiments.step_cost import reported
from experiments.z_width import z_widths
from steer_env.errors import InputError
from steer_env.plants import Reference
from steer_env.rig.motors import MOTORS

LIMIT_KMH = (45.0, 75.0, 105.0)  # speeds at which the limit is found

Advance = Callable[..., None]


def benchmark(
    names: Sequence[str | tuple[str, Maker]] = tuple(controllers.CONTROLLERS),
    reference: Reference | None = None,
    *,
    quick: bool = False,
    seed: int = 0,
    jobs: int = 1,
    out: Path | None = None,
    ray: str | None = None,
    advance: Advance = lambda *_, **__: None,
    motor: str | None = None,
    systems: Sequence[System] = (),
) -> dict[str, Any]:
    """Everything the benchmark finds, as written to scores.json (and to ``out``, if given).

    ``motor`` is a row of MOTORS: the steer-by-wire cases then go through the CAN path of its stepped virtual motor,
    and scores.json has ``rig``; exhibits, limit, Z-width and step cost, which no path changes, stay away.

    ``systems`` are ranked over, without any all that every controller is made for; scores.json says under ``left_out``
    which are not and why, and under ``policies`` what the policies are.

    ``names`` are rows of CONTROLLERS, policy, policy:FOLDER, FILE.py:NAME, or pairs (name, make) with a make(plant,
    reference, causality) -> Controller of your own. The proof works with ``jobs`` processes: a script
    that asks for more than one must guard its main part by ``if __name__ == "__main__"``.
    """
    protocol, chosen = Protocol.load(), reference or Reference.load("published")
    makers = {pair[0]: pair[1] for pair in names if not isinstance(pair, str)}
    plain = [name if isinstance(name, str) else name[0] for name in names]
    store = None if out is None else out / "cases"
    there = SYSTEMS if motor is None else bench_rig.RIG_SYSTEMS
    files = [name for name in plain if name not in makers]
    chosen_systems, left_out = ranked(files, systems, there)
    about = {"left_out": left_out, "policies": policies_of(files)}
    if motor is not None:
        driven = bench_rig.rig_benchmark(
            plain, chosen, motor, quick, seed, jobs, store, advance, makers, chosen_systems
        )
        return write_scores(out, driven.results, chosen.source, seed, driven.gates, {**driven.proof, **about}, quick)
    cases = cases_of(plain, protocol, quick, chosen_systems)
    results = run_cases(cases, chosen, seed, jobs, store, advance, makers, ray)
    gates, proof = gates_of(plain, chosen, results, makers, quick, jobs, advance, chosen_systems)
    speeds, arms = ((QUICK_KMH,), ("relaxed",)) if quick else (LIMIT_KMH, protocol.arms)
    proof["limit"] = as_records(limits(plain, chosen, speeds, makers, arms, chosen_systems))
    advance(note="limit")
    if not quick:
        widths = z_widths(plain, chosen, makers, advance, chosen_systems)
        proof["z_width"] = [width._asdict() for width in widths]
    proof["step_cost"] = reported(plain, chosen, makers, chosen_systems)
    advance(note="step cost")
    return write_scores(out, results, chosen.source, seed, gates, {**proof, **about}, quick)


def cases_of(
    names: Sequence[str], protocol: Protocol, quick: bool, systems: Sequence[System] = SYSTEMS
) -> list[Case]:
    """Exhibits and test cases of controllers on systems."""
    speed = bench_cases.LINEAR_SPEED_KMH
    exhibits = bench_cases.grid(names, (speed,), ("relaxed",) if quick else bench_cases.ARMS)
    cases = [*exhibits, *(case for name in names for case in protocol.test_cases(name, quick))]
    return [case for case in cases if (case.plant, case.causality) in systems]


@click.command()
@click.option(
    "--reference",
    "source",
    default="published",
    show_default=True,
    metavar="FILE",
    help='A reference.json, or "published".',
)
@click.option(
    "--quick/--full",
    default=None,
    help="Only 75 km/h, the relaxed arm and one draw of each plant, or everything. [default: full; quick on a rig]",
)
@click.option(
    "--env",
    type=click.Choice(["simulated", "rig"]),
    default="simulated",
    show_default=True,
    help="rig: the steer-by-wire cases through the CAN path of a virtual motor, beside their simulated scores. Such an "
    "episode runs in Python, about 0.25 ms a period: a minute per controller for the 12 quick cases, an hour in full.",
)
@click.option("--motor", type=click.Choice(list(MOTORS)), default=None, help="Of the rig. [default: simulated]")
@click.option(
    "--controller",
    "own",
    multiple=True,
    metavar="NAME",
    help="One more controller: FILE.py:NAME of your own, policy (the shipped one), policy:FOLDER, or passivity:NAME. "
    "May be given again. With a policy all are ranked on the systems that it is made for.",
)
@click.option("--only", default="", metavar="NAMES", help="Of the shipped ones only these (with commas between).")
@click.option(
    "--system",
    "tasks",
    multiple=True,
    metavar="NAME",
    help="Only this one of the four systems, e.g. SbW-Impedance. May be given again. [default: all]",
)
@click.option("--ray", default=None, metavar="ADDRESS", help='Spread the cases over a Ray cluster ("auto": this one).')
@common_options
def command(
    source: str,
    quick: bool | None,
    env: str,
    motor: str | None,
    own: tuple[str, ...],
    only: str,
    tasks: tuple[str, ...],
    ray: str | None,
    out: Path,
    seed: int,
    jobs: int,
    quiet: bool,
    as_json: bool,
) -> None:
    """Rank controllers by how closely a wheel feels like its reference, and prove them stable.

    EPAS and steer-by-wire, impedance and admittance, seven speeds, three arms, six manoeuvres, plants
    drawn from their spread. Writes scores.json, scores.csv and report.html. An interrupted run goes on
    where it was.
    """
    if env == "rig":
        quick, motor = quick is not False, motor or "simulated"
        if ray is not None:
            raise InputError("--ray", "does not go with --env rig", "use --jobs")
    elif motor is not None:
        raise InputError("--motor", "is that of a rig", "add --env rig")
    quick = bool(quick)
    reference = Reference.load(source)
    names = [*_shipped(only), *own]
    for name in own:
        controllers.maker(name)  # a misspelt name ends here, not after minutes
    there = SYSTEMS if motor is None else bench_rig.RIG_SYSTEMS
    asked = tuple(map(system_of, tasks))
    systems, left_out = ranked(names, asked, there)
    if motor is None:
        # Proof and Z-width of each system, limit, step cost.
        total = len(cases_of(names, Protocol.load(), quick, systems)) + len(systems) * (1 if quick else 2) + 2
    else:
        cases = bench_rig.rig_cases(names, Protocol.load(), quick, systems)
        total = 2 * len(cases) + len(systems)  # simulated too; the proof
    with progress("benchmark", total=total, quiet=quiet) as advance:
        summary = benchmark(
            names, reference, quick=quick, seed=seed, jobs=jobs, out=out, ray=ray, advance=advance, motor=motor,
            systems=asked,
        )  # fmt: skip
    if as_json:
        print_json({k: v for k, v in summary.items() if k != "results"})
        return
    proven = {gate["controller"] for gate in summary["gates"]}
    print_table(*ranking_table([Standing(**row) for row in summary["ranking"]], proven), title=words_of(systems))
    if left_out:
        click.echo(f"Left out: {reasons_of(left_out)}")
    if motor is not None:
        print_table(*bench_rig.beside_table(summary["rig"]["beside"]), title=f"CAN path of {motor} and simulation")
    click.echo(f"Report: {out / 'report.html'}")


def _shipped(only: str) -> list[str]:
    names = [name.strip() for name in only.split(",") if name.strip()]
    for name in names:
        if name not in controllers.CONTROLLERS:
            known = ", ".join(controllers.CONTROLLERS)
            raise InputError("--only", f"{name!r} is not known", f"use names out of {known}")
    return names or list(controllers.CONTROLLERS)
