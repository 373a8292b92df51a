"""What the numbers of a benchmark say, in words: one verdict per plant, causality and controller.

Nothing here is written beforehand: every sentence is chosen by, and filled with, measured numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from experiments.bench_cases import MANOEUVRES

BASELINE = "open_loop_map"
LIMIT_DB, LIMIT_DEG = 1.5, 10.0  # asked for at 75 km/h, 0.2-4 Hz, against the linear reference
REQUIRED_BAND_HZ = (0.2, 4.0)
CLEARLY = 2.0  # a controller beats the map clearly where the map's error is twice its own


class Verdict(NamedTuple):
    """Summary of one controller on one plant and causality; None where it cannot be told.

    ``error`` is the geometric mean over cases of the tracking error over the rms of the reference;
    ``factor`` how many times larger the map's is, over the same cases. The two worst deviations
    are those from the linear reference at 75 km/h.
    """

    plant: str
    causality: str
    controller: str
    error: float | None
    factor: float | None
    unstable: int
    worst_magnitude_dB: float | None
    worst_phase_deg: float | None
    within: bool | None
    short: str
    text: str


def verdicts(results: Sequence[dict[str, Any]]) -> list[Verdict]:
    """Verdicts in the order in which plant, causality and controller appear."""
    keys = dict.fromkeys(
        (r["case"]["plant"], r["case"]["causality"], r["case"]["controller"]) for r in results
    )
    return [_verdict(key, results) for key in keys]


def _verdict(key: tuple[str, str, str], results: Sequence[dict[str, Any]]) -> Verdict:
    plant, causality, name = key
    here = [r for r in results if (r["case"]["plant"], r["case"]["causality"]) == key[:2]]
    own = _full(here, name)
    unstable = sum(not r["stable"] for r in here if r["case"]["controller"] == name)
    error = _geometric_mean(_error(r) for r in own)
    factor = None if name == BASELINE else _factor(own, _full(here, BASELINE))
    linear = _linear(here, name, prompt=False)
    magnitude = _largest(linear, "worst_magnitude")
    phase = _largest(linear, "worst_phase")
    within = None
    if magnitude is not None and phase is not None:
        within = magnitude <= LIMIT_DB and phase <= LIMIT_DEG
    bare = Verdict(
        plant, causality, name, error, factor, unstable, magnitude, phase, within, "", ""
    )
    return bare._replace(short=_short(bare), text=_text(bare, here))


def _full(results: Iterable[dict[str, Any]], name: str) -> list[dict[str, Any]]:
    """Chirps and sines with the complete reference of one controller."""
    return [
        r
        for r in results
        if r["case"]["controller"] == name and not r["case"]["linear"] and r["case"]["manoeuvre"] in MANOEUVRES
    ]


def _linear(results: Iterable[dict[str, Any]], name: str, prompt: bool) -> list[dict[str, Any]]:
    return [
        r
        for r in results
        if r["case"]["controller"] == name and r["case"]["linear"] and r["case"]["prompt"] == prompt
    ]


def _error(result: dict[str, Any]) -> float | None:
    error: float | None = result["scores"].get("tracking_relative")
    return error


def _geometric_mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None and value > 0.0]
    return math.exp(sum(map(math.log, known)) / len(known)) if known else None


def _factor(own: list[dict[str, Any]], others: list[dict[str, Any]]) -> float | None:
    """How many times larger the other's error is, case by case; unstable cases count for none."""
    theirs = {_place(r): _error(r) for r in others}
    ratios = []
    for result in own:
        mine, other = _error(result), theirs.get(_place(result))
        if mine and other:
            ratios.append(other / mine)
    return _geometric_mean(ratios)


def _place(result: dict[str, Any]) -> tuple[Any, ...]:
    case = result["case"]
    return case["speed_kmh"], case["manoeuvre"], case["arm"]


def _largest(results: list[dict[str, Any]], metric: str) -> float | None:
    if not results or any(r["scores"].get(metric) is None for r in results):
        return None
    return max(float(r["scores"][metric]) for r in results)


def _short(v: Verdict) -> str:
    if v.unstable:
        return f"unstable in {v.unstable} case{'s' * (v.unstable > 1)}"
    linear = {True: "within 1.5 dB, 10 deg", False: "beyond 1.5 dB, 10 deg", None: ""}[v.within]
    if v.factor is None:
        return linear
    beats = "clearly better than the map" if v.factor >= CLEARLY else "not clearly better"
    return f"{beats}; {linear}" if linear else beats


def _text(v: Verdict, here: list[dict[str, Any]]) -> str:
    sentences = []
    if v.unstable:
        sentences.append(f"{v.unstable} of its cases turned unstable and are left out of means.")
    if v.error is not None:
        tracked = "torque" if v.causality == "impedance" else "angle"
        sentences.append(
            f"Its {tracked} error is {100.0 * v.error:.1f} % of the reference on average."
        )
        sentences.append(_largest_error(v, here))
    if v.factor is not None:
        word = "clearly" if v.factor >= CLEARLY else "not clearly"
        sentences.append(f"The open-loop map's is {v.factor:.1f} times that: {word} beaten.")
    if v.within is not None:
        sentences += _linear_sentences(v, here)
    return " ".join(sentences)


def _largest_error(v: Verdict, here: list[dict[str, Any]]) -> str:
    worst = max(_full(here, v.controller), key=lambda r: _error(r) or 0.0)
    case = worst["case"]
    manoeuvre = "chirp" if case["manoeuvre"] == "frequency_response" else "0.2 Hz sine"
    return (
        f"The largest is {100.0 * (_error(worst) or 0.0):.1f} %, in the {manoeuvre} at "
        f"{case['speed_kmh']:.0f} km/h with the {case['arm']} arm."
    )


def _linear_sentences(v: Verdict, here: list[dict[str, Any]]) -> list[str]:
    size = f"{v.worst_magnitude_dB:.2f} dB and {v.worst_phase_deg:.1f} deg"
    if v.within:
        first = f"At 75 km/h it stays within {size} of the linear reference over 0.2-4 Hz."
    else:
        first = (
            f"At 75 km/h it departs from the linear reference by up to {size} over 0.2-4 Hz "
            f"(asked for: {LIMIT_DB} dB, {LIMIT_DEG:.0f} deg), {_where(v, here)}."
        )
    return [first, *_cause(v, here)]


def _cause(v: Verdict, here: list[dict[str, Any]]) -> list[str]:
    """What the same controller leaves without delay and sensor noise, and so what is at fault."""
    prompt = _linear(here, v.controller, prompt=True)
    dB, deg = _largest(prompt, "worst_magnitude"), _largest(prompt, "worst_phase")
    if dB is None or deg is None:
        looks = "It looks at no error: what the hardware adds, the driver feels."
        return [looks] if v.controller == BASELINE and not v.within else []
    left = f"Without delay and sensor noise {dB:.2f} dB and {deg:.1f} deg remain"
    if v.within:
        return [f"{left}."]
    delay = dB <= LIMIT_DB and deg <= LIMIT_DEG
    return [f"{left}: {'delay and sensors are' if delay else 'the law itself is'} the cause."]


def _where(v: Verdict, here: list[dict[str, Any]]) -> str:
    """The frequencies at which the limits are left, and whether the arm matters."""
    places = []
    for result in _linear(here, v.controller, prompt=False):
        plot = result["plot"]
        f = np.array(plot["frequency_Hz"])
        H = np.array(plot["achieved_real"]) + 1j * np.array(plot["achieved_imag"])
        R = np.array(plot["reference_real"]) + 1j * np.array(plot["reference_imag"])
        band = (f >= REQUIRED_BAND_HZ[0]) & (f <= REQUIRED_BAND_HZ[1])
        ratio = (H / R)[band]
        out = (np.abs(20.0 * np.log10(np.abs(ratio))) > LIMIT_DB) | (
            np.abs(np.degrees(np.angle(ratio))) > LIMIT_DEG
        )
        if out.any():
            low, high = f[band][out].min(), f[band][out].max()
            places.append(f"{low:.1f}-{high:.1f} Hz with the {result['case']['arm']} arm")
    return "at " + " and ".join(places)
