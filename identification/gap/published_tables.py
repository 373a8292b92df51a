"""The gap method on the paper's own tables: what local refits hide (theory: Tables 2 and 3).

The paper refits the steering trail at every speed. With one trail for all speeds the on-centre stiffness of Table 3
is far off at low speed; one stiffness at the pinion that does not depend on speed brings it back. What its size is, and
is not, follows from its interval and from what kingpin geometry can give.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student_t

from identification.frf import Floats
from identification.steady_state import STEADY_HZ
from steer_env.physics.effects import EFFECTS
from steer_env.physics.linear import VEHICLE_OUTPUTS, frequency_response, single_track_matrices
from steer_env.physics.vehicle import SingleTrack
from steer_env.plants.reference_file import ReferenceFile, published
from steer_env.plants.reference_row import ReferenceRow
from steer_env.units import from_kmh

# What the tables do not give, as in theory section 6: mass and wheelbase of the car class, mean axle stiffness.
MASS, WHEELBASE = 1950.0, 2.94  # kg, m
TRAIL = 0.0827  # m, one for all speeds


class TablesGap(NamedTuple):
    """Fit of the seven on-centre stiffnesses with and without a stiffness of its own.

    Errors are relative rms; ``stiffness`` in N m/rad with its 95 % interval; ``l_f`` in m and ``i_s`` of the fit.
    """

    error_before: float
    error_after: float
    stiffness: float
    interval: tuple[float, float]
    l_f: float
    i_s: float
    predicted: Floats
    measured: Floats
    verdict: str


def on_centre(rows: Sequence[ReferenceRow], l_f: float, i_s: float, extra: float) -> Floats:
    """Stiffness at the pinion in N m/rad, per row: magnitude of Eq. 9 at 0.2 Hz with one trail, plus ``extra``."""
    found = []
    for row in rows:
        track = SingleTrack(
            MASS, l_f, WHEELBASE - l_f, row.J_z, row.C_f, row.C_r, row.sigma_f, row.sigma_r, TRAIL, i_s
        )
        H = frequency_response(single_track_matrices(from_kmh(row.speed_kmh), track), np.array([STEADY_HZ]))
        slip = H[0, VEHICLE_OUTPUTS.index("slip_front"), 0]
        found.append(abs(row.C_f * TRAIL * slip / i_s**2 + extra))
    return np.array(found)


def published_gap(reference: ReferenceFile | None = None) -> TablesGap:
    """Fit l_f and i_s alone, then with one pinion stiffness for all speeds."""
    rows = (reference or published()).rows
    measured = np.array([row.c_pin_on for row in rows])
    plain = SingleTrack()

    def error(x: Floats) -> Floats:
        extra = x[2] if x.size > 2 else 0.0
        wrong: Floats = on_centre(rows, x[0], x[1], extra) / measured - 1.0
        return wrong

    before = least_squares(error, [plain.l_f, plain.i_s])
    after = least_squares(error, [plain.l_f, plain.i_s, 1.0])
    freedom = measured.size - 3
    variance = float(np.sum(after.fun**2)) / freedom
    std = float(np.sqrt(variance * np.linalg.inv(after.jac.T @ after.jac)[2, 2]))
    half = float(student_t.ppf(0.975, freedom)) * std
    stiffness = float(after.x[2])
    jacking = EFFECTS["vehicle"]["jacking_torque"].plausible["stiffness_Nm_per_rad"]
    verdict = (
        f"a speed-independent pinion stiffness of {stiffness:.1f} N m/rad ({stiffness - half:.1f} to "
        f"{stiffness + half:.1f}); "
    )
    if stiffness - half > jacking.high:
        verdict += (
            f"jacking gives at most {jacking.high:g} N m/rad, so jacking alone is ruled out: a tyre's torsion, a ratio "
            "that changes at large angles or scrub must have a part in it"
        )
    else:
        verdict += "jacking can be its cause"
    return TablesGap(
        float(np.sqrt(np.mean(before.fun**2))),
        float(np.sqrt(np.mean(after.fun**2))),
        stiffness,
        (stiffness - half, stiffness + half),
        float(after.x[0]),
        float(after.x[1]),
        on_centre(rows, float(after.x[0]), float(after.x[1]), stiffness),
        measured,
        verdict,
    )
