"""Everything that the reproduction found, in one record: what the report draws and figures.json holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments import paper_checks as checks
from experiments.paper_car import OurCar, complex_of
from experiments.paper_closed_loops import ClosedLoop
from experiments.paper_generators import Harmonics
from experiments.paper_peaks import PAPER_SPEEDS_KMH, Peaks, closed_form, measured, stepped
from experiments.paper_published import Executed
from experiments.paper_statements import STATEMENTS, Finding, Subject
from steer_env.plants import Reference

PAPER_YAW_INERTIA = 3150.0  # kg m2, Section 4.1
CAMPAIGN_END_HZ = 4.5  # a sweep that ends at 5 Hz fades there: a maximum beyond is its end, not a peak
SUBJECTS = {
    "published": "published rows",
    "printed": "our car, the paper's steps as printed",
    "refined": "our car, refined",
    "truth": "our car, its truth",
}


@dataclass(frozen=True)
class Results:
    """The published reference (linear), its rows executed, our car, and the closed loops."""

    published: Reference
    executed: list[Executed]
    car: OurCar
    loops: list[ClosedLoop]

    def at(self, speed_kmh: float) -> Executed:
        """The executed published row of a speed."""
        return {x.speed_kmh: x for x in self.executed}[speed_kmh]

    def subjects(self) -> dict[str, Subject]:
        """Whom the statements are asked of, by a key of SUBJECTS."""
        driven = {s.speed_kmh: s.hysteresis() for s in self.car.speeds}
        theory = self.car.vehicle.yaw_inertia
        return {
            "published": published_subject(self.published, self.executed),
            "printed": Subject(self.car.reference("printed"), driven, theory),
            "refined": Subject(self.car.reference("refined"), driven, theory),
            "truth": Subject(self.car.true_reference(), driven, theory),
        }

    def statements(self) -> list[dict[str, Any]]:
        """Each statement with a Finding per subject, where it can be asked."""
        subjects = self.subjects()
        rows = [
            {"says": s.says, "where": s.where, "findings": {n: s.ask(subject) for n, subject in subjects.items()}}
            for s in STATEMENTS
        ]
        x, ref, car = self.executed, self.published, self.car
        more: list[tuple[str, str, dict[str, Finding]]] = [
            (
                "Friction does not affect the response at large amplitude",
                "3.4",
                {"published": checks.friction(x, ref), "printed": checks.friction_on_ours(car)},
            ),
            (
                "Linear model and response differ mostly at low frequency (assist)",
                "4.1",
                {"published": checks.low_frequency(x, ref), "printed": checks.low_frequency_of_ours(car)},
            ),
            ("Generators follow the linearised reference (Figure 9)", "4.2", {"published": checks.generators(x)}),
            ("Impedance and admittance generators agree", "4.2", {"published": checks.generators_agree(x)}),
            (
                "Controllers follow the reference (Figures 9, 10; here PID)",
                "4.2",
                {"published": checks.controllers(self.loops)},
            ),
        ]
        return rows + [{"says": says, "where": where, "findings": found} for says, where, found in more]

    def peaks(self) -> list[tuple[str, list[Peaks]]]:
        """Label, and the two peaks at each of PAPER_SPEEDS_KMH."""
        speeds = PAPER_SPEEDS_KMH
        executed = [self.at(v) for v in speeds]
        closed = {
            "published rows, Eq. 10": self.published,
            "our car, the paper's steps as printed": self.car.reference("printed"),
            "our car, the paper's steps, Eq. 9": self.car.reference("steps"),
            "our car, refined": self.car.reference("refined"),
            "our car, its truth": self.car.true_reference(),
        }
        rows = [(label, [closed_form(reference, v) for v in speeds]) for label, reference in closed.items()]
        rows.insert(1, ("published rows with friction", [_peaks_of(x.frictional) for x in executed]))
        rows.insert(2, ("published rows, complete reference", [_peaks_of(x.complete[0]) for x in executed]))
        rows.insert(3, ("our car, measured", [self._measured_peaks(v) for v in speeds]))
        return rows

    def _measured_peaks(self, speed_kmh: float) -> Peaks:
        found = self.car.at(speed_kmh).responses
        f, angle = complex_of(found["pinion_angle"].measured)
        f_rate, rate = complex_of(found["pinion_rate"].measured)
        return measured((f, np.abs(angle)), (f_rate, np.abs(rate)), CAMPAIGN_END_HZ)


def published_subject(published: Reference, executed: list[Executed]) -> Subject:
    """The published rows, with the loops that our generator makes of them."""
    return Subject(published, {x.speed_kmh: x.loop for x in executed}, PAPER_YAW_INERTIA)


def _peaks_of(found: Harmonics) -> Peaks:
    return stepped(found.frequency, np.abs(found.angle), np.abs(found.rate))
