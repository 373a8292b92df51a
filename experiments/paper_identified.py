"""Our virtual vehicle, driven and identified by the paper's steps, and kept on disk for a rerun."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import identification
from experiments import paper_car, paper_steps
from experiments.paper_car import OurCar, OurSpeed, Response
from experiments.paper_steps import Steps, printed_steps
from experiments.simulate import Order, finished, recipe, simulate
from identification.campaign import read_campaign
from identification.identify import Options, identify
from identification.result import SpeedResult
from steer_env import atomic
from steer_env.plants.reference_file import read_vehicle, vehicle_table
from steer_env.plants.reference_row import ReferenceRow
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import SINE_REPEATS, SPEEDS_KMH

REPEATS = 3
BODY = ("yaw_rate", "lateral_acceleration", "sideslip_angle", "rack")
PINION = ("pinion_angle", "pinion_rate")
STORE = "identified.json"
Advance = Callable[..., None]


def our_car(out: Path, seed: int, jobs: int, advance: Advance) -> OurCar:
    """Simulate and identify into ``out``, or read what an earlier call left there."""
    order, car = Order(SPEEDS_KMH, REPEATS, seed, clean=False), VirtualCar()
    folder, key = out / "campaign", recipe(order, car)
    truth = finished(folder, key)
    if truth is None:
        with atomic.folder(folder, key) as staging:
            truth = simulate(order, car, staging, jobs, advance)
    else:
        advance(steps=_runs(), note="campaign from an earlier run")
    content = _stored(out / STORE, _key(truth))
    if content is None:
        content = _identified(out, _key(truth), jobs, advance)
        atomic.write_text(out / STORE, json.dumps(content) + "\n")
    else:
        advance(steps=len(SPEEDS_KMH) + 1, note="identification from an earlier run")
    vehicle = read_vehicle(content["vehicle"], str(out / STORE))
    return OurCar(vehicle, [_from_json(t) for t in content["speeds"]], truth["rows"])


def steps_of_our_car() -> int:
    """Number of steps that ``our_car`` advances by."""
    return _runs() + len(SPEEDS_KMH) + 1


def _runs() -> int:
    return len(SPEEDS_KMH) * (REPEATS + SINE_REPEATS + 2)  # slow cornering, and the truth


def _identified(out: Path, key: str, jobs: int, advance: Advance) -> dict[str, Any]:
    campaign = read_campaign(out / "campaign")
    assert campaign.vehicle is not None  # our own campaign states it
    printed = printed_steps(campaign)
    advance(note="Eq. 10 as printed")
    options = Options(modes=("per-speed",), slip="relaxed")
    result = identify(campaign, options, jobs, advance)
    speeds = [_reduced(r, printed[r.speed_kmh]) for r in result.modes["per-speed"]]
    return {
        "key": key,
        "vehicle": vehicle_table(campaign.vehicle),
        "speeds": [asdict(speed) for speed in speeds],
    }


def _key(truth: dict[str, Any]) -> str:
    """Name of everything an identification depends on: the data and the method's own code."""
    digest = hashlib.sha256(json.dumps(truth["provenance"], sort_keys=True).encode())
    sources = sorted(Path(identification.__path__[0]).glob("*.py"))
    for module in (__file__, paper_car.__file__, paper_steps.__file__, *sources):
        digest.update(Path(str(module)).read_bytes())
    return digest.hexdigest()[:16]


def _stored(path: Path, key: str) -> dict[str, Any] | None:
    """What an earlier run identified from the same data, None where anything differs."""
    try:
        content: dict[str, Any] = json.loads(path.read_text("utf-8"))
        return content if content["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None  # absent, cut short or edited: it is made anew


def _from_json(table: dict[str, Any]) -> OurSpeed:
    responses = {name: Response(**response) for name, response in table["responses"].items()}
    return OurSpeed(**{**table, "responses": responses})


def _reduced(result: SpeedResult, printed: Steps) -> OurSpeed:
    """What the report shows of a speed."""
    loop = result.loops[0]
    curves = {
        "angle": loop.angle,
        "measured": loop.measured,
        "steps": loop.stepwise,
        "refined": loop.refined,
    }
    # Step III-a takes c_pin_on from the vehicle alone, so all forms share it.
    on = {"c_pin_on": result.values["c_pin_on"]}
    on_error = {"c_pin_on": result.std["c_pin_on"]}
    forms = {"printed": printed.values | on, "steps": result.frf | on, "refined": result.values}
    errors = {
        "printed": printed.std | on_error,
        "steps": result.frf_std | on_error,
        "refined": result.std,
    }
    return OurSpeed(
        result.speed_kmh,
        {form: _row(values) for form, values in forms.items()},
        {form: _row(values) for form, values in errors.items()},
        result.unidentified(),
        {name: _response(result, name, printed) for name in (*BODY, *PINION)},
        {name: curve.tolist() for name, curve in curves.items() if curve is not None},
    )


def _response(result: SpeedResult, name: str, printed: Steps) -> Response:
    H = result.responses[name]
    fitted = {"steps": _rows(*result.fitted[name])}
    if name in PINION:
        f, values = printed.fitted
        fitted["printed"] = _rows(f, values[:, PINION.index(name)])
        fitted["refined"] = _rows(*result.fitted[f"{name} refined"])
    gamma = zip(H.all_frequency, H.all_coherence, strict=True)
    return Response(_rows(H.frequency, H.value), [(float(f), float(g)) for f, g in gamma], fitted)


def _rows(frequency: Any, value: Any) -> paper_car.Rows:
    return [(float(f), float(H.real), float(H.imag)) for f, H in zip(frequency, value, strict=True)]


def _row(table: dict[str, float]) -> dict[str, float]:
    """The finite numbers among the keys of a reference row."""
    keys = ReferenceRow._fields
    return {n: float(v) for n, v in table.items() if n in keys and np.isfinite(v)}
