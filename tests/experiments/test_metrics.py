"""Every metric against a case whose answer is known in closed form."""

import numpy as np
import pytest

from experiments import measures
from experiments.metrics import METRICS, REQUIRED_BAND_HZ, score
from steer_env.envs.layout import PERIOD
from steer_env.manoeuvres import MANOEUVRES
from tests.experiments.trials import answered, chirp, sine, trial

CYCLE = np.arange(0.0, 4.0, PERIOD) * 2.0 * np.pi * 0.5  # two cycles


def test_response_error_of_a_gain_and_a_phase():
    f = np.linspace(0.1, 6.0, 60)
    reference = 1.0 / (1.0 + 1j * f)
    error = measures.response_error(f, 2.0 * np.exp(0.1j) * reference, reference, (0.2, 5.0))
    assert error.frequency[0] >= 0.2
    assert error.frequency[-1] <= 5.0
    np.testing.assert_allclose(error.magnitude, 20.0 * np.log10(2.0), rtol=1e-12)
    np.testing.assert_allclose(error.phase, np.degrees(0.1), rtol=1e-12)


def test_log_rms_weighs_octaves_alike():
    """On a dense grid the mean over log f of f^2 from 1 to e is (e^2 - 1) / 2."""
    f = np.linspace(1.0, np.e, 20001)
    assert measures.log_rms(f, f) == pytest.approx(np.sqrt((np.e**2 - 1.0) / 2.0), rel=1e-4)
    assert np.isnan(measures.log_rms(f[:0], f[:0]))


def test_half_width_of_an_ellipse_and_of_dry_friction():
    """sin(t) against sin(t - phi) is sin(phi) wide; Coulomb friction of M_C is M_C wide."""
    x = np.sin(CYCLE)
    assert measures.half_width(x, np.sin(CYCLE - 0.3)) == pytest.approx(np.sin(0.3), rel=1e-5)
    friction = 5.0 * x + 0.7 * np.sign(np.cos(CYCLE))
    assert measures.half_width(x, friction) == pytest.approx(0.7, rel=1e-3)
    assert np.isnan(measures.half_width(np.ones(9), np.ones(9)))


def test_centre_slope_ignores_friction_and_what_lies_off_centre():
    """Cubic spring with friction: the slope at zero, up to the 10 % window's x^2 share."""
    x = np.sin(CYCLE)
    y = 5.0 * x + 2.0 * x**3 + 0.7 * np.sign(np.cos(CYCLE))
    assert measures.centre_slope(x, y) == pytest.approx(5.0, rel=0.005)


def test_loop_area_is_the_work_of_friction():
    """4 A M_C per cycle for dry friction, pi A B sin(phi) for an ellipse."""
    x = 0.5 * np.sin(CYCLE)
    assert measures.loop_area(x, 0.7 * np.sign(np.cos(CYCLE)), 2) == pytest.approx(1.4, rel=2e-3)
    ellipse = measures.loop_area(x, 3.0 * np.sin(CYCLE - 0.3), 2)
    assert ellipse == pytest.approx(np.pi * 0.5 * 3.0 * np.sin(0.3), rel=2e-3)


def left_above(frequency, cut_off=20.0):
    """Gain of the filter run both ways: a Butterworth of order 4, squared, at its prewarped frequency."""
    share = np.tan(np.pi * cut_off * PERIOD) / np.tan(np.pi * frequency * PERIOD)
    return 1.0 / (1.0 + share**8)


def test_high_passed_keeps_only_what_is_faster():
    t = np.arange(0.0, 4.0, PERIOD)
    slow, fast = np.sin(2.0 * np.pi * 5.0 * t), np.sin(2.0 * np.pi * 50.0 * t)
    left = measures.high_passed(1.0 + slow + 0.2 * fast, 20.0, PERIOD)
    expected = left_above(5.0) * slow + 0.2 * left_above(50.0) * fast
    inside = slice(500, -500)
    np.testing.assert_allclose(left[inside], expected[inside], atol=1e-6)


def test_a_held_corner_is_no_ripple():
    """Catches a spectral cut: a record that ends higher than it began would jump back at its end."""
    t = np.arange(0.0, 4.0, PERIOD)
    risen = 3.0 * np.clip(t - 0.5, 0.0, 1.0)
    assert measures.rms(measures.high_passed(risen, 20.0, PERIOD)) < 0.01
    assert measures.high_passed(risen[:20], 20.0, PERIOD).size == 0


def test_low_passed_leaves_lines_and_halves_power_at_its_frequency():
    t = np.arange(0.0, 4.0, PERIOD)
    line = 2.0 - 3.0 * t
    np.testing.assert_allclose(measures.low_passed(line, 5.0, PERIOD)[200:-200], line[200:-200], rtol=1e-9)
    wave = np.sin(2.0 * np.pi * 5.0 * t)
    left = measures.low_passed(wave, 5.0, PERIOD)
    np.testing.assert_allclose(left[200:-200], wave[200:-200] / np.sqrt(2.0), atol=1e-4)


def test_the_linear_reference_scores_zero_against_itself():
    """Catches a wrong instrument, a wrong analytic curve and a bias of the estimate."""
    torque = chirp()
    signals = {"steering_torque": torque, "torsion_bar_torque": torque}
    found = score(trial("frequency_response", linear=True, pinion_angle=answered(torque), **signals))
    assert found["worst_magnitude"] < 0.02
    assert found["worst_phase"] < 0.2
    assert found["frf_complex"] < 0.002


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_a_gain_of_a_tenth_and_five_milliseconds_are_found(linear, causality):
    """Catches a ratio upside down, a phase sign that a square hides, a wrong band."""
    torque, ideal = chirp(), answered(chirp())
    late = answered(torque, 1.1, 0.005)
    if causality == "impedance":
        signals = {"pinion_angle": late, "torsion_bar_torque": torque}
        # The ideal torque at the achieved angle is 1.1 times the torque, 5 ms late.
        signals["reference"] = 1.1 * np.interp(
            np.arange(len(torque)) * PERIOD - 0.005, np.arange(len(torque)) * PERIOD, torque
        )
    else:
        signals = {"pinion_angle": late, "torsion_bar_torque": torque, "reference": ideal}
    t = trial("frequency_response", causality, linear, steering_torque=torque, **signals)
    found = score(t)
    assert found["frf_magnitude"] == pytest.approx(20.0 * np.log10(1.1), abs=0.03)
    assert found["worst_magnitude"] == pytest.approx(20.0 * np.log10(1.1), abs=0.05)
    f = t.response.frequency
    last = f[f <= REQUIRED_BAND_HZ[1]].max()
    assert found["worst_phase"] == pytest.approx(360.0 * last * 0.005, abs=0.3)
    assert np.all(t.error(REQUIRED_BAND_HZ).phase < 0.0), "late is negative"


@pytest.mark.parametrize(("causality", "unit"), [("impedance", 1.0), ("admittance", 180 / np.pi)])
def test_tracking_error_in_its_unit_and_relative(causality, unit):
    x, _ = sine()
    t = trial("steady_state", causality, reference=2.0 * x, error=0.1 * x)
    found = score(t)
    assert found["tracking_error"] == pytest.approx(0.1 * unit * measures.rms(x), rel=1e-12)
    assert found["tracking_relative"] == pytest.approx(0.05, rel=1e-12)


def test_loops_after_the_first_cycle_achieved_and_ideal():
    """Spring 40 N m/rad with friction 0.5 (achieved) and 0.8 (ideal); the first cycle is odd."""
    x, t = sine()
    sign = np.sign(np.cos(2.0 * np.pi * 0.2 * t))
    torque = 0.3 * 40.0 * x + 0.5 * sign
    torque[: round(5.4 / PERIOD)] += 3.0
    ideal = 0.3 * 40.0 * x + 0.8 * sign
    impedance = trial("steady_state", pinion_angle=0.3 * x, torsion_bar_torque=torque, reference=ideal)
    found = score(impedance)
    assert found["torque_hysteresis"] == pytest.approx(0.5, rel=2e-3)
    assert found["torque_hysteresis_reference"] == pytest.approx(0.8, rel=2e-3)
    assert found["angle_hysteresis"] == pytest.approx(np.degrees(0.5 / 40.0), rel=5e-3)
    assert found["on_centre_stiffness"] == pytest.approx(40.0 * np.pi / 180.0, rel=5e-3)
    assert found["loop_area"] == pytest.approx(4 * 0.3 * 0.5, rel=0.01)
    # In admittance the ideal is an angle: same torque, an angle that lags by friction of its own.
    swapped = trial(
        "steady_state", "admittance",
        pinion_angle=0.3 * x, torsion_bar_torque=12.0 * x, reference=0.3 * x - 0.02 * sign,
    )  # fmt: skip
    found = score(swapped)
    assert found["angle_hysteresis"] == pytest.approx(0.0, abs=0.01)
    assert found["angle_hysteresis_reference"] == pytest.approx(np.degrees(0.02), rel=5e-3)


def test_percentile_95_absolute_and_relative():
    """|A sin| stays below A sin(0.95 pi / 2) for 95 % of the time; relative is over the rms of the reference."""
    x, t = sine()
    x = np.where(t > 0.0, x, np.sin(2.0 * np.pi * 0.2 * t))
    found = score(trial("standstill", "admittance", reference=2.0 * x, error=0.1 * x))
    expected = 0.1 * np.sin(0.95 * np.pi / 2.0)
    assert found["tracking_p95"] == pytest.approx(np.degrees(expected), rel=1e-3)
    assert found["tracking_p95_relative"] == pytest.approx(expected / measures.rms(2.0 * x), rel=1e-3)
    assert found["tracking_jnd"] == pytest.approx(found["tracking_relative"] / 0.15, rel=1e-12)


def test_felt_torque_in_thresholds():
    """Torque 1.15 times the reference's is one just noticeable difference; half the causalities need no generator."""
    x, _ = sine()
    found = score(trial("standstill", torsion_bar_torque=2.3 * x, reference=2.0 * x))
    assert found["felt_torque_jnd"] == pytest.approx(1.0, rel=1e-12)
    assert found["felt_torque_error"] == pytest.approx(0.3 * measures.rms(x), rel=1e-12)
    assert found["felt_torque_p95"] < 0.3


def test_effort_saturation_and_ripple():
    t = PERIOD * np.arange(4000)
    ripple = 0.3 * np.sin(2.0 * np.pi * 40.0 * t)
    command = np.where(t < 1.0, 5.0, 1.0)  # the EPAS motor's limit is 5 N m
    found = score(
        trial("standstill", motor_torque=2.0 * np.ones(4000), command=command, pinion_rate=-0.5 * np.ones(4000),
              torsion_bar_torque=np.sin(2.0 * np.pi * 0.5 * t) + ripple, steering_torque=2.0 * ripple)
    )  # fmt: skip
    assert found["effort"] == pytest.approx(2.0)
    assert found["motor_power"] == pytest.approx(2.0 * 21.0 * 0.5)  # the motor turns 21 times as fast
    assert found["saturation"] == pytest.approx(0.25)
    left = 0.3 * left_above(40.0)
    assert found["ripple"] == pytest.approx(left / np.sqrt(2.0), rel=2e-3)
    assert found["ripple_peak_to_peak"] == pytest.approx(2.0 * left, rel=0.02)
    assert found["hand_ripple"] == pytest.approx(2.0 * left / np.sqrt(2.0), rel=0.01)
    fastest = 0.3 * 2.0 * np.pi * 40.0
    assert found["hand_jerk"] == pytest.approx(2.0 * fastest / np.sqrt(2.0), rel=5e-3)
    assert found["jerk"] == pytest.approx(np.hypot(fastest, np.pi) / np.sqrt(2.0), rel=5e-3)


def test_slew_saturation_counts_periods_at_the_limit():
    """The EPAS motor's command may change by 1 N m a period: up, down and up again in one of four."""
    command = np.tile([1.0, 1.0, 0.9, 0.0], 500)
    found = score(trial("standstill", command=command))
    assert found["slew_saturation"] == pytest.approx(0.25, abs=1e-3)
    assert found["saturation"] == 0.0


def test_setting_off_and_letting_go_are_no_jerk_of_the_hand():
    """The hand of the release manoeuvre sets off at 0.5 s and lets go at 3.5 s, here with jumps of 3 N m."""
    t = PERIOD * np.arange(9000)
    found = score(trial("release", steering_torque=np.where((t > 0.5) & (t < 3.5), 3.0, 0.0)))
    assert found["hand_jerk"] == 0.0
    assert found["hand_ripple"] < 1e-6


def test_energy_beyond_the_reference_at_the_same_motion():
    """An extra damping of -0.1 N m s/rad gives off 0.1 pi A^2 omega per cycle; +0.1 takes it up."""
    t = PERIOD * np.arange(4001)
    rate = 2.0 * np.cos(2.0 * np.pi * 0.5 * t)
    found = score(trial("standstill", torsion_bar_torque=-0.1 * rate, pinion_rate=rate))
    assert found["passivity_gap_energy"] == pytest.approx(-0.1 * 2.0 * 4.0, rel=1e-6)
    kept = score(trial("standstill", torsion_bar_torque=0.1 * rate, pinion_rate=rate))
    assert kept["passivity_gap_energy"] == 0.0
    spring = score(trial("standstill", torsion_bar_torque=np.sin(np.pi * t), pinion_rate=np.cos(np.pi * t)))
    assert spring["passivity_gap_energy"] == pytest.approx(0.0, abs=1e-9), "a spring gives back what it took"


def test_a_manoeuvre_gets_its_own_metrics_only():
    x, _ = sine()
    sine_scores = score(trial("steady_state", pinion_angle=x, torsion_bar_torque=x))
    assert "torque_hysteresis" in sine_scores
    assert "frf_phase" not in sine_scores
    for name, metric in METRICS.items():
        assert metric.unit, name
        assert metric.meaning, name
        assert set(metric.manoeuvres) <= set(MANOEUVRES), name
        assert metric.better in ("lower", "higher", "reference", ""), name
        if metric.better == "reference":
            assert METRICS[f"{name}_reference"].better == "", name


def test_hysteresis_width_survives_noise_on_the_torque():
    """Catches branches mixed by noise: a torque that changes its sign ten times on its way through zero."""
    t = np.linspace(0.0, 10.0, 10_000, endpoint=False)
    angle = np.sin(2 * np.pi * 0.2 * t)
    torque = 3.0 * np.sin(2 * np.pi * 0.2 * t + 0.1)
    noisy = torque + np.random.default_rng(0).normal(0.0, 0.1, t.size)
    exact = measures.half_width(torque, angle)
    assert exact == pytest.approx(np.sin(0.1), rel=1e-4)
    assert measures.half_width(noisy, angle) == pytest.approx(exact, rel=0.1)
