"""On-centre indices, their summary in thresholds, the assist's shape and the dead band, against closed forms."""

import numpy as np
import pytest

from experiments.measures import rms
from experiments.measures_loop import FLOOR_TORQUE, INDICES, Loop, dead_band, feel_jnd, indices, shape_error
from experiments.metrics import score
from steer_env.envs.layout import PERIOD
from steer_env.units import GRAVITY
from tests.experiments.trials import sine, trial

PHASE = 2.0 * np.pi * np.arange(0.0, 3.0, 2e-4)  # three cycles
REACH = 0.4  # rad
SIDE = np.sign(np.cos(PHASE))


def loop(stiffness=20.0, friction=0.7, acceleration=0.2):
    """A spring in N m/rad with dry friction in N m; lateral acceleration in g goes with the angle."""
    x = np.sin(PHASE)
    return Loop(REACH * x, stiffness * REACH * x + friction * SIDE, acceleration * x, 3)


def test_indices_of_a_spring_with_dry_friction():
    found = indices(loop())
    per_g = 20.0 * REACH / 0.2
    assert found["torque_hysteresis"] == pytest.approx(0.7, rel=1e-3)
    assert found["angle_hysteresis"] == pytest.approx(np.degrees(0.7 / 20.0), rel=2e-3)
    assert found["on_centre_stiffness"] == pytest.approx(np.radians(20.0), rel=1e-6)
    assert found["average_stiffness"] == pytest.approx(np.radians((20.0 * REACH + 0.7) / REACH), rel=1e-3)
    assert found["torque_gradient_0g"] == pytest.approx(per_g, rel=1e-6)
    assert found["torque_gradient_01g"] == pytest.approx(per_g, rel=1e-6)
    assert found["torque_0g"] == pytest.approx(0.7, rel=1e-3)
    assert found["torque_01g"] == pytest.approx(0.1 * per_g, rel=1e-6)
    assert found["returnability"] == pytest.approx(0.7 / per_g, rel=2e-3)
    assert found["loop_area"] == pytest.approx(4.0 * REACH * 0.7, rel=2e-3)


def test_gradients_tell_the_centre_from_off_centre():
    """Torque G a + C a^3: the slope is G at 0 g and, over a window of +-w, G + C (3 0.1^2 + 0.6 w^2) at 0.1 g."""
    a = 0.3 * np.sin(PHASE)
    found = indices(Loop(a, 20.0 * a - 100.0 * a**3, a, 3))
    assert found["torque_gradient_0g"] == pytest.approx(20.0, rel=0.01)
    assert found["torque_gradient_01g"] == pytest.approx(20.0 - 100.0 * (0.03 + 0.6 * 0.04**2), rel=0.01)
    assert found["torque_01g"] == pytest.approx(2.0 - 0.1, rel=1e-3)


def test_a_car_that_lags_is_seen_in_torque_at_0_g():
    """Torque k sin(p), acceleration a sin(p - q): torque at 0 g is k sin(q), none at 0 deg."""
    x, late = np.sin(PHASE), np.sin(PHASE - 0.3)
    found = indices(Loop(x, 3.0 * x, 0.3 * late, 3))
    assert found["torque_0g"] == pytest.approx(3.0 * np.sin(0.3), rel=1e-4)
    assert found["returnability"] == pytest.approx(0.3 * np.sin(0.3), rel=1e-4)
    assert found["torque_hysteresis"] == pytest.approx(0.0, abs=1e-6)
    lower = indices(Loop(x, 3.0 * x, 0.08 * late, 3))
    assert np.isnan(lower["torque_01g"]), "0.1 g was not reached"
    assert np.isnan(lower["torque_gradient_01g"])


def test_feel_in_thresholds():
    """Torque 1.15 times too high moves eight of ten indices by one threshold and the two widths at 0 N m by none."""
    ideal = loop(friction=2.0)
    heavier = Loop(ideal.angle, 1.15 * ideal.torque, ideal.acceleration, 3)
    assert len(INDICES) == 10
    assert feel_jnd(indices(heavier), indices(ideal), ideal) == pytest.approx(np.sqrt(0.8), rel=1e-3)
    assert feel_jnd(indices(ideal), indices(ideal), ideal) == 0.0


def test_vanishing_friction_is_judged_on_the_floor():
    """Catches a division by a reference without friction: 15 % of the floor's torque is one threshold everywhere."""
    ideal, rubbing = loop(200.0, 0.0), loop(200.0, 0.15 * FLOOR_TORQUE)
    shares = [1.0] * 5 + [1.0 / (200.0 * REACH)] + [0.0] * 4  # the average stiffness has the friction at its peak
    assert feel_jnd(indices(rubbing), indices(ideal), ideal) == pytest.approx(rms(np.array(shares)), rel=5e-3)


def test_the_shape_of_the_assist_is_free_of_friction():
    """Springs of 10 and 11 N m/rad with other frictions; the angles that count end where the ideal has 5 N m."""
    grid = np.linspace(-0.95 * 0.6, 0.95 * 0.6, 101)
    inside = grid[np.abs(10.0 * grid) <= 5.0]
    x = 0.6 * np.sin(PHASE)
    ideal, felt = Loop(x, 10.0 * x + 0.5 * SIDE, x, 3), Loop(x, 11.0 * x + 2.0 * SIDE, x, 3)
    assert shape_error(felt, ideal) == pytest.approx(rms(inside), rel=1e-3)
    assert shape_error(ideal, ideal) == 0.0
    same = Loop(x, 10.0 * x + 2.0 * SIDE, x, 3)
    assert shape_error(same, ideal) == pytest.approx(0.0, abs=1e-3)


def test_dead_band_of_a_slow_ramp():
    """Nothing up to 1.5 deg, then 0.02 g per deg; the bend in between does not matter, nor what follows 0.15 g."""
    control = np.linspace(0.0, 20.0, 20001)
    answer = np.maximum(control - 1.5, 0.0) * 0.02
    assert dead_band(control, answer) == pytest.approx(1.5, rel=1e-9)
    bent = np.where(answer > 0.2, 0.2 + 3.0 * (answer - 0.2), answer)
    bent[answer < 0.03] *= 0.5
    assert dead_band(control, bent) == pytest.approx(1.5, rel=1e-9)
    assert np.isnan(dead_band(control, 0.3 * answer))
    assert np.isnan(dead_band(np.zeros(20001), answer))


def test_dead_band_of_a_trial():
    """Friction of 1 N m before the car answers; the reference has 1.5; the bar of 143.24 N m/rad twists."""
    t = PERIOD * np.arange(1, 20001)
    rising = 0.3 * np.clip(t / 20.0, 0.0, 1.0)
    angle = np.radians(50.0) * rising
    found = score(
        trial(
            "constant_speed_cornering", pinion_angle=angle, lateral_acceleration=GRAVITY * rising,
            torsion_bar_torque=1.0 + 20.0 * rising, reference=1.5 + 20.0 * rising,
        )
    )  # fmt: skip
    assert found["torque_dead_band"] == pytest.approx(1.0, rel=1e-3)
    assert found["torque_dead_band_reference"] == pytest.approx(1.5, rel=1e-3)
    assert found["angle_dead_band"] == pytest.approx(np.degrees(1.0 / 143.24), rel=1e-3)
    assert found["angle_dead_band_reference"] == pytest.approx(np.degrees(1.5 / 143.24), rel=1e-3)


@pytest.mark.parametrize("manoeuvre", ["steady_state", "on_centre_weave"])
def test_a_trial_reads_whole_cycles_after_the_first(manoeuvre):
    """Achieved 40 N m/rad with friction 1.2, ideal 1.5; the first cycle is odd, and noise is not friction."""
    x, t = sine(21.5)
    x = np.where(t < 20.0, x, 0.0)
    side = np.sign(np.cos(2.0 * np.pi * 0.2 * t))
    noise = np.random.default_rng(0).normal(0.0, 0.05, x.size)
    torque = 12.0 * x + 1.2 * side + noise
    torque[: round(5.2 / PERIOD)] += 3.0
    signals = {"pinion_angle": 0.3 * x, "torsion_bar_torque": torque, "lateral_acceleration": 0.2 * GRAVITY * x}
    found = score(trial(manoeuvre, reference=12.0 * x + 1.5 * side, **signals))
    assert found["torque_hysteresis"] == pytest.approx(1.2, rel=0.02)
    assert found["torque_hysteresis_reference"] == pytest.approx(1.5, rel=2e-3)
    assert found["torque_gradient_0g"] == pytest.approx(60.0, rel=0.02)
    assert found["torque_01g_reference"] == pytest.approx(6.0, rel=2e-3)
    assert found["returnability"] == pytest.approx(1.2 / 60.0, rel=0.05)
    assert found["assist_shape_error"] < 0.02
    less = -0.3 / (0.15 * 1.5)  # five friction indices are 0.3 of 1.5 N m low, the average stiffness 0.3 of 13.5
    expected = np.sqrt((5.0 * less**2 + (0.3 / (0.15 * 13.5)) ** 2) / 10.0)
    assert found["feel_jnd"] == pytest.approx(expected, rel=0.05)


def test_less_than_two_cycles_are_no_loop():
    x, _ = sine(8.5)
    found = score(trial("on_centre_weave", parameters={"duration": 8.0}, pinion_angle=x, torsion_bar_torque=x))
    assert np.isnan(found["torque_hysteresis"])
    assert np.isnan(found["feel_jnd"])
    assert np.isnan(found["assist_shape_error"])
