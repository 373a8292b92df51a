"""Campaigns for blind tests: a virtual car with effects of the catalogue hidden in it, and the sealed answer.

Nothing in the folder tells what is hidden: names, columns, metadata and order are those of any campaign. The answer
lies beside the folder, where nothing that identifies looks.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from steer_env import atomic
from steer_env.errors import InputError
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics.effects import EFFECTS, Effect
from steer_env.testcar.campaign_writer import campaign_toml, run_file, write_run
from steer_env.testcar.drive import Hidden, drive, generator_of, hidden_of
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import PlannedRun, sine_amplitude
from steer_env.units import quantities

MANOEUVRES_DRIVEN = ("frequency_response", "steady_state", "on_centre_weave")
# Wheel angle of a manoeuvre against that of the 0.2 Hz sine.
SHARES = {"steady_state": 1.0, "on_centre_weave": 0.3, "step_steer": 0.5, "constant_speed_cornering": 1.1}
Present = dict[str, dict[str, float]]


def drawn_parameters(effect: Effect, rng: np.random.Generator) -> dict[str, float]:
    """Parameters of an effect from its plausible range: sizes log-uniform, ratios and phases uniform, signs even."""
    values = effect.absent()._asdict()
    for name, plausible in effect.plausible.items():
        if plausible.low > 0.0 and not plausible.low < 1.0 < plausible.high:
            value = math.exp(rng.uniform(math.log(plausible.low), math.log(plausible.high)))
        else:
            value = rng.uniform(plausible.low, plausible.high)
        values[name] = float(value * (rng.choice((-1.0, 1.0)) if plausible.signed else 1.0))
    return values


def parse_hidden(texts: Sequence[str], seed: int, kind: str = "vehicle") -> Present:
    """Effects from NAME, NAME=VALUE or NAME:parameter=value,...; what is not given is drawn by the seed.

    "none" hides nothing; "random" draws one effect, or in one case of five none.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(20,)))
    table = EFFECTS[kind]
    present: Present = {}
    for text in texts:
        name, _, given = text.partition(":")
        name, equals, amplitude = name.partition("=")
        if name == "none":
            continue
        if name == "random":
            if rng.random() < 0.8:
                name = str(rng.choice(list(table)))
                present[name] = drawn_parameters(table[name], rng)
            continue
        if name not in table:
            raise InputError("--hide", f"there is no effect '{name}' of a {kind}", f"give one of {', '.join(table)}")
        effect = table[name]
        values = drawn_parameters(effect, rng)
        if equals:
            values[effect.amplitude] = _number(amplitude, text)
        for part in filter(None, given.split(",")):
            key, _, value = part.partition("=")
            if key not in values:
                raise InputError("--hide", f"'{name}' has no parameter '{key}'", f"give one of {', '.join(values)}")
            values[key] = _number(value, text)
        for key, quantity in quantities(effect.parameters).items():
            if not quantity.low <= values[key] <= quantity.high:
                raise InputError(
                    "--hide",
                    f"{key} = {values[key]:g} of '{name}' is out of range",
                    f"give a value from {quantity.low:g} to {quantity.high:g} {quantity.unit}",
                )
        present[name] = values
    return present


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError("--hide", f"'{text}' in '{where}' is not a number", "write NAME=VALUE")
    return value


def planned_runs(speed_kmh: float, repeats: int, manoeuvres: Sequence[str], car: VirtualCar) -> list[PlannedRun]:
    """``repeats`` runs of each manoeuvre at one speed."""
    sine = sine_amplitude(speed_kmh, car)
    fastest = 2.0 * math.pi * MANOEUVRES["frequency_response"].parameters.frequency_end
    amplitude = {name: share * sine for name, share in SHARES.items()}
    amplitude["frequency_response"] = min(sine, car.robot.rate_limit / fastest)
    return [PlannedRun(speed_kmh, name, k + 1, amplitude[name]) for name in manoeuvres for k in range(repeats)]


def hidden_campaign(
    folder: Path,
    present: Mapping[str, Mapping[str, float]],
    car: VirtualCar,
    seed: int,
    speeds_kmh: Sequence[float],
    repeats: int = 3,
    manoeuvres: Sequence[str] = MANOEUVRES_DRIVEN,
    jobs: int = 1,
    advance: Callable[..., None] = lambda **_: None,
    change: Callable[..., dict[str, Any]] | None = None,
) -> None:
    """Drive ``car`` with the effects ``present`` in it and write the campaign into ``folder``.

    ``change(columns, rng)`` may alter what was logged before it is written.
    """
    hidden: Hidden = hidden_of(present)
    runs = [run for v in speeds_kmh for run in planned_runs(v, repeats, manoeuvres, car)]

    def one(run: PlannedRun) -> None:
        rng = generator_of(run, seed)
        columns = drive(run, car, rng, hidden)
        write_run(folder / run_file(run), columns if change is None else change(columns, rng))
        advance(note=f"{run.speed_kmh:g} km/h")

    if jobs > 1:
        with ThreadPoolExecutor(max_workers=jobs) as pool:
            list(pool.map(one, runs))
    else:
        for run in runs:
            one(run)
    atomic.write_text(folder / "campaign.toml", campaign_toml("virtual test vehicle", car, runs))


def answer_path(folder: Path) -> Path:
    """The sealed file beside a campaign's folder."""
    return folder.parent / f"{folder.name}.answer.json"


def write_answer(folder: Path, present: Mapping[str, Mapping[str, float]], seed: int) -> None:
    """Seal what is hidden in the campaign of ``folder``."""
    effects: list[dict[str, Any]] = [{"name": name, "parameters": dict(p)} for name, p in present.items()]
    text = json.dumps({"schema_version": 1, "seed": seed, "effects": effects}, indent=1)
    atomic.write_text(answer_path(folder), text + "\n")
