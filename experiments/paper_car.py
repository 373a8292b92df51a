"""Our virtual vehicle as identified: measured and fitted responses, parameters, its truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.frf import Complexes, Floats
from steer_env.plants import Reference
from steer_env.plants.reference_file import ReferenceFile
from steer_env.plants.reference_row import KnownVehicle, ReferenceRow, file_keys

FORMS = {
    "printed": "the paper's steps, Eq. 10 as printed",
    "steps": "the paper's steps, rack torque of Eq. 9",
    "refined": "refined in time domain, rack torque of Eq. 9",
}
_SLIP = {"printed": "kinematic", "steps": "relaxed", "refined": "relaxed"}
Rows = list[tuple[float, float, float]]


@dataclass(frozen=True)
class Response:
    """A measured response and fits by form, as rows of (Hz, real, imaginary); gamma over Hz."""

    measured: Rows
    coherence: list[tuple[float, float]]
    fitted: dict[str, Rows]


@dataclass(frozen=True)
class OurSpeed:
    """One speed of our car in km/h.

    ``values`` and ``std`` hold a table by names of ReferenceRow for each of FORMS; ``loop`` holds
    pinion angle in rad and torsion-bar torque in N m: measured, steps, refined.
    """

    speed_kmh: float
    values: dict[str, dict[str, float]]
    std: dict[str, dict[str, float]]
    unidentified: list[str]
    responses: dict[str, Response]
    loop: dict[str, list[float]]

    def hysteresis(self) -> tuple[Floats, Floats]:
        """Measured pinion angle in rad and torsion-bar torque in N m at 0.2 Hz."""
        return np.array(self.loop["angle"]), np.array(self.loop["measured"])


@dataclass(frozen=True)
class OurCar:
    """Speeds ascending, and the car's true rows (truth.json)."""

    vehicle: KnownVehicle
    speeds: list[OurSpeed]
    truth: list[dict[str, float]]

    def at(self, speed_kmh: float) -> OurSpeed:
        """One speed; KeyError where it was not driven."""
        return {s.speed_kmh: s for s in self.speeds}[speed_kmh]

    def reference(self, form: str) -> Reference:
        """The linear reference of one of FORMS.

        What the paper's steps leave open is taken from the refined values.
        """
        rows = [{**s.values["refined"], **s.values[form]} for s in self.speeds]
        return self._reference(rows, _SLIP[form])

    def true_rows(self) -> list[dict[str, float]]:
        """The car's true parameters by names of ReferenceRow, speeds ascending."""
        names = {key: name for name, key in file_keys(ReferenceRow).items()}
        return [{names[k]: v for k, v in row.items() if k in names} for row in self.truth]

    def true_reference(self) -> Reference:
        """The car's true linear parameters as a reference; its tyres do relax."""
        return self._reference(self.true_rows(), "relaxed")

    def _reference(self, rows: list[dict[str, float]], slip: str) -> Reference:
        keys = [n for n in ReferenceRow._fields if n != "speed_kmh"]
        table = tuple(
            ReferenceRow(s.speed_kmh, **{n: row[n] for n in keys}) for s, row in zip(self.speeds, rows, strict=True)
        )
        none: tuple[dict[str, float], ...] = tuple({} for _ in table)
        file = ReferenceFile(self.vehicle, table, slip, none, none, tuple(() for _ in table))
        return Reference(file, linear=True, match_stiffness=False, source="our car")


def complex_of(rows: Rows) -> tuple[Floats, Complexes]:
    """Frequency in Hz and complex value [n] of rows of (Hz, real, imaginary)."""
    f, real, imaginary = np.array(rows, dtype=float).reshape(-1, 3).T
    return f, real + 1j * imaginary
