"""The seven published rows: stability, stiffness, response, against numbers found elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from steer_env.physics import linear
from steer_env.physics.friction import dahl_step
from steer_env.plants import DRIVERS, Reference
from steer_env.plants.reference import steady_stiffness

SPEEDS_kmh = (105, 90, 75, 60, 45, 30, 15)
# Field report 6.4, set R: largest real part, and the slow or pinion mode (real, imaginary), 1/s.
KINEMATIC = {
    105: (-2.57, -13.9, 26.4),
    90: (-3.14, -12.6, 24.9),
    75: (-4.08, -12.5, 25.3),
    60: (-6.05, -8.9, 25.4),
    45: (-7.56, -7.6, 25.7),
    30: (-5.53, -8.5, 25.7),
    15: (-4.18, -11.6, 28.6),
}
RELAXED = {
    105: (-2.57, -13.5, 26.6),
    90: (-3.14, -12.2, 25.0),
    75: (-4.07, -11.9, 25.6),
    60: (-3.41, -3.4, 23.6),
    45: (-1.40, -1.4, 22.3),
    30: (-1.68, -1.7, 23.7),
    15: (-3.86, -3.9, 28.9),
}
# deg/N m at 0.2, 1, 2, 3, 5 Hz with 1 + k_gain (field report 6.4).
FREQUENCIES = (0.2, 1.0, 2.0, 3.0, 5.0)
ANGLE_PER_TORQUE = {
    75: (5.90, 8.56, 7.91, 6.68, 4.60),
    90: (4.49, 7.79, 7.89, 6.50, 4.37),
    105: (3.36, 6.27, 7.35, 5.79, 4.25),
    45: (11.66, 10.40, 8.31, 7.48, 4.49),
}


def bare(kmh: float, relaxed: bool = False):
    """A published row with set R and nothing added."""
    return Reference(match_stiffness=False).at(kmh / 3.6)._replace(relaxed=float(relaxed))


def eigenvalues(kmh: float, p, K: float = 1.0) -> np.ndarray:
    return np.linalg.eigvals(linear.reference_matrices(kmh / 3.6, p, K)[0])


@pytest.mark.parametrize("kmh", SPEEDS_kmh)
@pytest.mark.parametrize(("relaxed", "table"), [(False, KINEMATIC), (True, RELAXED)])
def test_every_row_is_stable_with_the_known_modes(kmh, relaxed, table):
    """Catches a wrong row, sign or slip form. Set R is known to four digits: 0.02 1/s."""
    poles = eigenvalues(kmh, bare(kmh, relaxed))
    largest, real, imaginary = table[kmh]
    assert poles.real.max() < 0.0
    assert poles.real.max() == pytest.approx(largest, abs=0.02)
    assert np.abs(poles - complex(real, imaginary)).min() < 0.08


@pytest.mark.parametrize("kmh", SPEEDS_kmh)
@pytest.mark.parametrize("relaxed", [False, True])
def test_every_row_stays_stable_with_the_missing_stiffness(kmh, relaxed):
    """The added pinion stiffness must not cost stability; worst -1.2 1/s (field report 6.4)."""
    p = Reference().at(kmh / 3.6)._replace(relaxed=float(relaxed))
    assert eigenvalues(kmh, p).real.max() < -1.1


@pytest.mark.parametrize("kmh", ANGLE_PER_TORQUE)
def test_response_to_torque_is_the_known_one(kmh):
    """Catches a wrong gain (1 + k_gain), slip form or unit in the linear reference."""
    p = bare(kmh)
    matrices = linear.reference_matrices(kmh / 3.6, p, 1.0 + p.k_gain)
    response = np.degrees(np.abs(linear.frequency_response(matrices, FREQUENCIES)[:, 0, 0]))
    assert response == pytest.approx(ANGLE_PER_TORQUE[kmh], abs=0.02)


def test_relaxed_slip_is_a_different_reference_at_45_kmh():
    """Both slip forms share the statics; 17.3 against 7.5 deg/N m at 3 Hz says which is used."""
    p = bare(45, relaxed=True)
    matrices = linear.reference_matrices(12.5, p, 1.0 + p.k_gain)
    assert np.degrees(abs(linear.frequency_response(matrices, 3.0)[0, 0, 0])) == pytest.approx(
        17.3, abs=0.1
    )


@pytest.mark.parametrize("row", Reference().file.rows, ids=lambda row: f"{row.speed_kmh:g}kmh")
def test_on_centre_stiffness_is_that_of_table_3(row):
    """Set R alone is within 0.5 % from 60 km/h; the added stiffness closes the rest."""
    speed = row.speed_kmh / 3.6
    alone = steady_stiffness(speed, bare(row.speed_kmh))
    if row.speed_kmh >= 60.0:
        assert alone == pytest.approx(row.c_pin_on, rel=0.005)
    else:
        assert row.c_pin_on - alone == pytest.approx(1.61, abs=0.03)  # one constant for all three
    matched = Reference().at(speed)
    assert steady_stiffness(speed, matched) == pytest.approx(row.c_pin_on, rel=1e-10)


@pytest.mark.parametrize("row", Reference().file.rows, ids=lambda row: f"{row.speed_kmh:g}kmh")
def test_linear_gain_lies_between_on_and_off_centre(row):
    """1 < 1 + k_gain < c_on / c_off: the linear gain is a describing function of the curve."""
    assert row.k_gain > 0.0
    assert (1.0 + row.k_gain) * row.c_pin_off < row.c_pin_on


@pytest.mark.parametrize(
    ("kmh", "half_width_deg"),
    [(30, 9.85), (45, 6.45), (60, 5.11), (75, 4.03), (90, 3.48), (105, 3.18)],
)
def test_angle_hysteresis_half_width_is_friction_over_stiffness(kmh, half_width_deg):
    """M_C / c_pin_on from a slow sweep of friction and spring: zero torque is that far out."""
    row = next(r for r in Reference().file.rows if r.speed_kmh == kmh)
    angles = np.linspace(2.0, -2.0, 40001)
    friction, torque = row.M_fric_C, []
    for step in np.diff(angles).tolist():
        friction = dahl_step(friction, step, row.M_fric_C, row.c_fric)
        torque.append(friction)
    total = row.c_pin_on * angles[1:] + torque
    crossing = angles[1:][np.argmax(total <= 0.0)]
    assert np.degrees(crossing) == pytest.approx(half_width_deg, abs=0.02)


def closed_loop(kmh: float, p, driver, J_s: float, b_s: float, K: float) -> float:
    """Largest real part of wheel and arm on a perfect reference: K times them add to it."""
    held = p._replace(
        J_ref=p.J_ref + K * (J_s + driver.J),
        b_ref=p.b_ref + K * (b_s + driver.b),
        c_extra=p.c_extra + K * driver.k,
    )
    return float(eigenvalues(kmh, held).real.max())


@pytest.mark.parametrize("name", [n for n in DRIVERS if n != "torque_source"])
@pytest.mark.parametrize("matched", [False, True])
def test_perfect_tracking_is_stable_with_every_driver(name, matched):
    """A controller cannot be blamed for what the reference itself does with an arm: all stable."""
    worst = max(
        closed_loop(kmh, p._replace(relaxed=relaxed), DRIVERS[name], 0.04, 0.1, K)
        for kmh in SPEEDS_kmh
        for relaxed in (0.0, 1.0)
        for p in [Reference(match_stiffness=matched).at(kmh / 3.6)]
        for K in (1.0, 1.0 + p.k_gain)
    )
    assert worst < -1.0


def test_a_heavy_limp_arm_at_105_kmh_is_a_property_of_the_reference():
    """The reference is active below 1.3 Hz there: mass without damping cannot be stable."""
    p = bare(105)
    limp = DRIVERS["relaxed"]._replace(J=0.16, b=0.05, k=2.0)
    assert closed_loop(105, p, limp, 0.04, 0.1, 1.0 + p.k_gain) > 0.0
    assert closed_loop(75, bare(75), limp, 0.04, 0.1, 1.0 + bare(75).k_gain) < 0.0
