"""Step II: reference inertia, damping and linearised assist from the pinion's frequency responses (Section 3.4.3).

The model is Eq. 10 with step I's vehicle; pinion angle and rate per torsion-bar torque are compared in magnitude and
phase (Eq. 11). Friction and the shape of the assist curve are ignored here, as in the paper, and leak into all three
values; ``refine`` removes that.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from identification.frf import Complexes, Floats, FrequencyResponse
from identification.stages import Chain, ResponseTerm, Values
from identification.vehicle import single_track
from steer_env.physics.linear import frequency_response, reference_matrices
from steer_env.physics.reference import ReferenceParameters
from steer_env.plants.reference_row import KnownVehicle

BOUNDS = {"J_ref": (0.002, 0.6), "b_ref": (-5.0, 10.0), "k_gain": (0.0, 40.0)}  # kg m2, N m s/rad, -
START = {"J_ref": 0.06, "b_ref": 0.7, "k_gain": 2.0}
OUTPUTS = ("pinion_angle", "pinion_rate")


@dataclass
class PinionModel:
    """Eq. 10 at one speed in m/s; ``lines`` [n, 3] in Hz; ``slip`` is "relaxed" or "kinematic"."""

    speed: float
    lines: Floats
    vehicle: KnownVehicle
    slip: str = "relaxed"
    _key: tuple[float, ...] = ()
    _value: Complexes = field(default_factory=lambda: np.zeros(0, complex))

    def response(self, values: Values) -> Complexes:
        """H [n, 3, 2] from torsion-bar torque to pinion angle and rate."""
        p = ReferenceParameters(
            J_ref=values["J_ref"],
            b_ref=values["b_ref"],
            k_gain=values["k_gain"],
            relaxed=float(self.slip == "relaxed"),
            linear=1.0,
            **single_track(values, self.vehicle)._asdict(),
        )
        if tuple(p) != self._key:
            matrices = reference_matrices(self.speed, p, 1.0 + p.k_gain)
            H = frequency_response(matrices, self.lines.ravel())[:, :, 0]
            self._key, self._value = tuple(p), H.reshape(*self.lines.shape, -1)
        return self._value

    def output(self, values: Values, measured: FrequencyResponse) -> Complexes:
        """The response that ``measured`` is named after, with the lag of the torque signal taken out."""
        H = self.response(values)[measured.point, :, OUTPUTS.index(measured.name)]
        lead: Complexes = np.exp(2j * np.pi * measured.line_frequency * values.get("delay_bar", 0.0))
        return H * lead


@dataclass
class PinionIdentification:
    """Step II at one speed. Fitted: ``params_``, ``std_``, ``chain_``."""

    vehicle: KnownVehicle
    slip: str = "relaxed"

    def fit(
        self, angle: FrequencyResponse, rate: FrequencyResponse, lines: Floats, speed: float, chain: Chain
    ) -> PinionIdentification:
        """Fit J_ref, b_ref and k_gain with the vehicle of ``chain`` held; returns self."""
        model = PinionModel(speed, lines, self.vehicle, self.slip)
        terms = [ResponseTerm(r, model.output, speed, 0.5, 0.5) for r in (angle, rate)]
        self.chain_ = chain.copy().fit(terms, START, BOUNDS)
        self.model_ = model
        std = self.chain_.std_
        self.params_ = {n: self.chain_.values[n] for n in START}
        self.std_ = {n: std[n] for n in START if n in std}
        return self
