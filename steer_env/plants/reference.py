"""The haptic reference over speed: published or identified rows, for generators and design."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from steer_env.physics import linear
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.rows import place
from steer_env.plants.reference_file import ReferenceFile, published, read_reference
from steer_env.plants.reference_row import ReferenceRow
from steer_env.units import check_ranges, from_kmh, to_kmh

if TYPE_CHECKING:
    import control

STEADY_FREQUENCY_Hz = 0.2  # the paper's steady state


@dataclass(frozen=True)
class Reference:
    """A reference file with two choices: linear (Eq. 10, Fig. 9) or complete (Eqs. 13-15, Fig. 10).

    ``match_stiffness`` adds to each row the pinion stiffness c_extra that its single track lacks
    against its own measured c_pin_on at 0.2 Hz: about 1.6 N m/rad at 45 km/h and below in the
    published rows and nothing above. What that stiffness is, the tables do not tell.
    """

    file: ReferenceFile = field(default_factory=published)
    linear: bool = False
    match_stiffness: bool = True
    source: str = "published"
    speed: float = from_kmh(75.0)  # m/s, for a method that is given none; an environment puts its own

    @classmethod
    def load(cls, source: str | Path | Reference, linear: bool | None = None) -> Reference:
        """From "published", a path or a Reference; ``linear`` None keeps the source's choice.

        A file is read and digested once, until it changes.
        """
        if isinstance(source, Reference):
            if linear is None or linear == source.linear:
                return source
            return replace(source, linear=linear)
        path = Path(source)
        changed = path.stat().st_mtime_ns if path.is_file() else 0
        return _loaded(str(source), changed, bool(linear))

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """Rows over speed [n, 1 + n_fields]: speed in m/s, then ReferenceParameters."""
        rows = []
        for row in self.file.rows:
            parameters = self._parameters(row)
            check_ranges(parameters, f"reference {self.source}, {row.speed_kmh:g} km/h")
            rows.append((from_kmh(row.speed_kmh), *parameters))
        return np.array(rows, dtype=float)

    def at(self, speed: float) -> ReferenceParameters:
        """Parameters at a speed in m/s: straight between rows, held beyond the ends."""
        low, high, share = place(speed, self.table)
        below = self.table[low, 1:]
        return ReferenceParameters(*(below + share * (self.table[high, 1:] - below)).tolist())

    def to_statespace(self, speed: float | None = None) -> control.StateSpace:
        """Eq. 10 at a speed in m/s: torsion_bar_torque to pinion_angle and pinion_rate, named."""
        import control

        speed = self.speed if speed is None else speed
        p = self.at(speed)
        A, B, C, D = linear.reference_matrices(speed, p, 1.0 + p.k_gain)
        return control.ss(
            A,
            B,
            C,
            D,
            inputs=["torsion_bar_torque"],
            outputs=["pinion_angle", "pinion_rate"],
            states=list(linear.REFERENCE_STATES),
            name=f"reference_{to_kmh(speed):.0f}_kmh",
        )

    def _parameters(self, row: ReferenceRow) -> ReferenceParameters:
        vehicle = self.file.vehicle
        bare = ReferenceParameters(
            J_ref=row.J_ref,
            b_ref=row.b_ref,
            k_gain=row.k_gain,
            M_fric_C=row.M_fric_C,
            c_fric=row.c_fric,
            r=row.c_pin_off / row.c_pin_on,
            sigma=row.sigma_assist,
            c_extra=0.0,
            relaxed=1.0 if self.file.slip == "relaxed" else 0.0,
            linear=1.0 if self.linear else 0.0,
            m=vehicle.mass,
            l_f=vehicle.cg_to_front_axle,
            l_r=vehicle.cg_to_rear_axle,
            J_z=row.J_z,
            C_f=row.C_f,
            C_r=row.C_r,
            sigma_f=row.sigma_f,
            sigma_r=row.sigma_r,
            n_t=row.n_t,
            i_s=vehicle.steering_ratio,
        )
        if not self.match_stiffness:
            return bare
        return bare._replace(c_extra=missing_stiffness(from_kmh(row.speed_kmh), bare, row.c_pin_on))


@lru_cache(maxsize=32)
def _loaded(source: str, changed: int, linear: bool) -> Reference:
    """One object for each content, so that its table is made once; ``changed`` is the file's time."""
    file = published() if source == "published" else read_reference(source)
    return Reference(file, linear, source=source)


def steady_stiffness(speed: float, p: ReferenceParameters) -> float:
    """|load torque / pinion angle| at 0.2 Hz in N m/rad: c_pin_on of the parameters themselves."""
    return float(abs(linear.frequency_response(linear.load_matrices(speed, p), STEADY_FREQUENCY_Hz)[0, 0, 0]))


def missing_stiffness(speed: float, p: ReferenceParameters, c_pin_on: float) -> float:
    """Real stiffness in N m/rad that brings |load / pinion angle| at 0.2 Hz to ``c_pin_on``."""
    response = linear.frequency_response(linear.load_matrices(speed, p), STEADY_FREQUENCY_Hz)[0, 0, 0]
    in_phase = max(c_pin_on * c_pin_on - response.imag * response.imag, 0.0) ** 0.5
    return float(in_phase - response.real)
