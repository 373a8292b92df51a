"""The same controller, seed and manoeuvre in the simulated environment and through the whole CAN path.

    python -m experiments.rig_parity [--out outputs/rig-parity]

Below the codec is the stepped virtual motor with the same plant. Twice: with a wire on which frames take no time, where
the two differ by the resolution of the frames alone, and with one of 1 Mbit/s, where commands act 0.13 ms later and
samples are as much younger. Each without sensor noise and with it: the two then share their draws, so that noise is
compared and not averaged. Angle and torque are compared in steps of the sensors' own resolution, the frequency
responses from angle to torque (impedance) or torque to angle (admittance) in third-octave bands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import gymnasium
import numpy as np
from numpy.typing import NDArray

import controllers
from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.report.figures import Curve, bode
from experiments.report.page import Report
from steer_env.plants import PLANTS
from steer_env.rig.safety_limits import Limits
from steer_env.rig.virtual.wheel import PERFECT

Array = NDArray[np.float64]
SENSORS = PLANTS["SbW"].sensors
QUIET = SENSORS._replace(torque_noise=0.0)
# The plant's own limits and none besides: what is compared is the path, not the limiter.
OPEN = Limits(
    torque_cap=7.5, rate_up=1e5, rate_down=1e5, window_change=50.0, energy_store=500.0, energy_income=50.0,
    angle_limit=9.4,
)  # fmt: skip
WIRES: Mapping[str, Mapping[str, Any]] = {
    "no time": {"bitrate": 0, "dead_time": 1e-3},
    "1 Mbit/s": {"dead_time": 1e-3},
}
NOISES: Mapping[str, bool] = {"no noise": False, "same noise": True}
LAWS = ("pid", "lqg", "disturbance_observer", "policy")
BANDS_HZ = 0.4 * 2.0 ** (np.arange(11) / 3.0)  # 0.4 to 4 Hz in thirds of an octave
MOST_dB, MOST_deg = 0.2, 2.0


class Difference(NamedTuple):
    """One controller, noise and wire against the simulation: largest differences in quanta, and of the responses."""

    controller: str
    causality: str
    noise: str
    wire: str
    angle_quanta: float
    torque_quanta: float
    command_Nm: float
    gain_dB: float
    phase_deg: float
    mean_reward: float
    mean_reward_simulated: float


def episode(
    causality: str, name: str, duration: float, seed: int, virtual: Mapping[str, Any] | None, noisy: bool = False
) -> Array:
    """Signals and reward [n, 4] of one frequency response; ``virtual`` None: simulated, else over that wire.

    ``noisy``: with the sensors' noise, whose draws are the same in both. A drive measures as a command comes, one
    period after the simulation's sensor that is late by one: what it reads then has that period's draw.
    """
    task: dict[str, Any] = {"manoeuvre": "frequency_response", "duration": duration}
    task["sensors"] = SENSORS if noisy else QUIET
    if virtual is None:
        env = gymnasium.make(f"steer_env/SbW-{causality.capitalize()}-v0", **task)
    else:
        options = {"imperfections": PERFECT, "seed": seed} | dict(virtual)
        env = gymnasium.make(
            f"steer_env/Rig-{causality.capitalize()}-v0", motor="simulated", limits=OPEN, virtual=options, **task
        )
    inside: Any = env.unwrapped
    controller = controllers.make(name, inside.plant, inside.reference, causality)
    rows, ended = [], False
    _, info = env.reset(seed=seed)
    controller.reset(1e-3)
    draws = None if virtual is None else iter([(0.0, 0.0), *inside.np_random.standard_normal((inside.periods, 2))])
    while not ended:
        if draws is not None:
            inside.connection.wheel.draws = partial(tuple, next(draws))
        torque = controller(info["observation"])
        _, reward, _, ended, info = env.step(inside.action_for(torque))
        seen = info["observation"]
        rows.append((seen.pinion_angle, seen.torsion_bar_torque, info["command"], float(reward)))
    env.close()
    if info["ended"] != "end of the manoeuvre":
        raise RuntimeError(f"{name} {causality}: {info['ended']}")
    return np.array(rows)


def response(causality: str, signals: Array) -> NDArray[np.complex128]:
    """Response in each of the BANDS_HZ: torque over angle in N m/rad, or angle over torque."""
    # The records start and end at rest: padded with rest, a short one still has lines in every band.
    length = 8 * len(signals)
    angle, torque = np.fft.rfft(signals[:, 0], length), np.fft.rfft(signals[:, 1], length)
    u, y = (angle, torque) if causality == "impedance" else (torque, angle)
    frequency = np.fft.rfftfreq(length, 1e-3)
    edge = 2.0 ** (1.0 / 6.0)
    inside = [(frequency >= f / edge) & (frequency < f * edge) for f in BANDS_HZ]
    return np.array([np.vdot(u[k], y[k]) / np.vdot(u[k], u[k]) for k in inside])


def difference(name: str, causality: str, noise: str, wire: str, simulated: Array, real: Array) -> Difference:
    """How far one run over a wire is from the simulated one."""
    most = np.abs(real - simulated)[:, :3].max(axis=0)
    ratio = response(causality, real) / response(causality, simulated)
    return Difference(
        name,
        causality,
        noise,
        wire,
        float(most[0] / SENSORS.angle_step),
        float(most[1] / SENSORS.torque_step),
        float(most[2]),
        float(np.abs(20.0 * np.log10(np.abs(ratio))).max()),
        float(np.abs(np.degrees(np.angle(ratio))).max()),
        float(real[:, 3].mean()),
        float(simulated[:, 3].mean()),
    )


def page(rows: Sequence[Difference], curves: Mapping[tuple[str, str, str], Mapping[str, Array]]) -> Report:
    """The report: the table, and the responses of each loop over each wire."""
    report = Report("Parity of the CAN path", "the same loop, simulated and through frames")
    report.text(__doc__.split("\n\n", 2)[2])
    report.table(
        Difference._fields, rows, "Largest differences; quanta are steps of the sensors' resolution", dense=True
    )
    for (name, causality, noise), runs in curves.items():
        report.section(f"{name}, {causality}, {noise}")
        lines = [Curve(wire, BANDS_HZ, response(causality, run)) for wire, run in runs.items()]
        unit = "N m/rad" if causality == "impedance" else "rad/(N m)"
        report.figure(bode(fits=lines, unit=unit), f"Response of {name} ({causality}), simulated and over each wire")
    return report


@click.command()
@click.option("--controller", "names", multiple=True, default=LAWS, help="May be given several times.")
@click.option("--duration", default=10.0, show_default=True, help="Seconds of the sweep.")
@common_options
def main(names: tuple[str, ...], duration: float, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Compare the simulated environment with the CAN path on the stepped virtual motor."""
    rows: list[Difference] = []
    curves: dict[tuple[str, str, str], dict[str, Array]] = {}
    cases = list(product(names, ("impedance", "admittance"), NOISES.items()))
    with progress("rig_parity", len(cases) * 3, quiet) as advance:
        for name, causality, (noise, noisy) in cases:
            runs = {"simulated": episode(causality, name, duration, seed, None, noisy)}
            advance(note=f"{name} {causality}")
            for wire, virtual in WIRES.items():
                runs[wire] = episode(causality, name, duration, seed, virtual, noisy)
                rows.append(difference(name, causality, noise, wire, runs["simulated"], runs[wire]))
                advance(note=f"{name} {causality} {wire}")
            curves[name, causality, noise] = runs
    out.mkdir(parents=True, exist_ok=True)
    path = page(rows, curves).write(out / "report.html")
    equal = all(row.gain_dB < MOST_dB and row.phase_deg < MOST_deg for row in rows)
    if as_json:
        print_json({"rows": [row._asdict() for row in rows], "equal": equal, "report": str(path)})
    else:
        print_table(Difference._fields, rows)
        click.echo(f"responses within {MOST_dB} dB and {MOST_deg} deg: {'yes' if equal else 'NO'}; {path}")


if __name__ == "__main__":
    main()
