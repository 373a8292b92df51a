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
from controllers import policy_file
from experiments import bench_cases, bench_rig
from experiments.bench_cases import Case, Maker
from experiments.bench_gates import gates_of
from experiments.bench_protocol import Protocol
from experiments.bench_ranking import Standing
from experiments.bench_run import run_cases
from experiments.bench_scores import ranking_table, write_scores
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
) -> dict[str, Any]:
    """Everything the benchmark finds, as written to scores.json (and to ``out``, if given).

    ``motor`` is a row of MOTORS: the steer-by-wire cases then go through the CAN path of its stepped virtual motor,
    and scores.json has ``rig``; exhibits, limit, Z-width and step cost, which no path changes, stay away.

    ``names`` are rows of CONTROLLERS, FILE.py:NAME, or pairs (name, make) with a make(plant,
    reference, causality) -> Controller of your own. The proof works with ``jobs`` processes: a script
    that asks for more than one must guard its main part by ``if __name__ == "__main__"``.
    """
    protocol, chosen = Protocol.load(), reference or Reference.load("published")
    makers = {pair[0]: pair[1] for pair in names if not isinstance(pair, str)}
    plain = [name if isinstance(name, str) else name[0] for name in names]
    store = None if out is None else out / "cases"
    if motor is not None:
        driven = bench_rig.rig_benchmark(plain, chosen, motor, quick, seed, jobs, store, advance, makers)
        return write_scores(out, driven.results, chosen.source, seed, driven.gates, driven.proof, quick)
    cases = cases_of(plain, protocol, quick)
    results = run_cases(cases, chosen, seed, jobs, store, advance, makers, ray)
    gates, proof = gates_of(plain, chosen, results, makers, quick, jobs, advance)
    speeds, arms = ((QUICK_KMH,), ("relaxed",)) if quick else (LIMIT_KMH, protocol.arms)
    proof["limit"] = as_records(limits(plain, chosen, speeds, makers, arms))
    advance(note="limit")
    if not quick:
        proof["z_width"] = [width._asdict() for width in z_widths(plain, chosen, makers, advance)]
    proof["step_cost"] = reported(plain, chosen, makers)
    advance(note="step cost")
    return write_scores(out, results, chosen.source, seed, gates, proof, quick)


def cases_of(names: Sequence[str], protocol: Protocol, quick: bool) -> list[Case]:
    """Exhibits and test cases of controllers."""
    speed = bench_cases.LINEAR_SPEED_KMH
    exhibits = bench_cases.grid(names, (speed,), ("relaxed",) if quick else bench_cases.ARMS)
    return [*exhibits, *(case for name in names for case in protocol.test_cases(name, quick))]


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
    help="One more controller: FILE.py:NAME of your own, or passivity:NAME. May be given again.",
)
@click.option("--only", default="", metavar="NAMES", help="Of the shipped ones only these (with commas between).")
@click.option("--ray", default=None, metavar="ADDRESS", help='Spread the cases over a Ray cluster ("auto": this one).')
@common_options
def command(
    source: str,
    quick: bool | None,
    env: str,
    motor: str | None,
    own: tuple[str, ...],
    only: str,
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
        if policy_file.is_policy(name):
            what = "a policy is made for one plant and causality, and the ranking is over four"
            mend = f"python -m experiments.policy_scores SbW-Impedance {name} pid lqg"
            raise InputError(f"--controller {name}", what, mend)
    parts = 6 if quick else 10  # proof and Z-width of four systems, limit, step cost
    if motor is None:
        total = len(cases_of(names, Protocol.load(), quick)) + parts
    else:
        total = 2 * len(bench_rig.rig_cases(names, Protocol.load(), quick)) + 2  # simulated too; proof of two systems
    with progress("benchmark", total=total, quiet=quiet) as advance:
        summary = benchmark(
            names, reference, quick=quick, seed=seed, jobs=jobs, out=out, ray=ray, advance=advance, motor=motor
        )
    if as_json:
        print_json({k: v for k, v in summary.items() if k != "results"})
        return
    proven = {gate["controller"] for gate in summary["gates"]}
    print_table(*ranking_table([Standing(**row) for row in summary["ranking"]], proven), title="All systems")
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
