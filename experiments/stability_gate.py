"""The gate: a controller whose loop is unstable where the reference is stable is unsafe.

With an arm with which the reference itself, perfectly tracked, is unstable (experiments.perfect_tracking)
nothing can be asked of a controller that tracks: such places are listed as the reference's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from experiments.arm_radius import SCALES
from experiments.assessment import Assessment
from steer_env.errors import InputError


class Gate(NamedTuple):
    """``failures`` are the controller's, ``reference_failures`` the reference's own; the rest is the worst.

    Worst values are over places where the reference is stable, and ``arm_radius`` over those where it
    is not the reference that gives out first.
    """

    safe: bool
    failures: tuple[str, ...]
    reference_failures: tuple[str, ...]
    growth: float
    gain_margin_dB: float
    phase_margin_deg: float
    disk_margin: float
    delay_margin_ms: float
    arm_radius: float
    passivity_gap: float
    bar_passivity_gap: float


def safe(assessments: Sequence[Assessment]) -> Gate:
    """The gate of a controller from its assessments; at least one is needed."""
    if not assessments:
        raise InputError("robustness", "there is nothing to judge", "give at least one assessment")
    judged = [a for a in assessments if a.reference_stable]
    own = [a.arm_radius for a in judged if a.arm_radius < a.reference_radius]
    failures = tuple(_words(a) for a in judged if not a.stable)
    return Gate(
        safe=not failures,
        failures=failures,
        reference_failures=tuple(_words(a) for a in assessments if not a.reference_stable and not a.stable),
        growth=max((a.growth for a in judged), default=0.0),
        gain_margin_dB=min((a.gain_margin_dB for a in judged), default=0.0),
        phase_margin_deg=min((a.phase_margin_deg for a in judged), default=0.0),
        disk_margin=min((a.disk_margin for a in judged), default=0.0),
        delay_margin_ms=min((a.delay_margin_ms for a in judged), default=0.0),
        arm_radius=min(own, default=max(SCALES)),
        passivity_gap=min((a.passivity_gap for a in judged), default=0.0),
        bar_passivity_gap=min((a.bar_passivity_gap for a in judged), default=0.0),
    )


def _words(a: Assessment) -> str:
    return f"{a.place}: grows by {a.growth:.1f} 1/s at {a.frequency_Hz:.1f} Hz"
