"""The ideal of an episode: compiled passes against what the environment recorded, and against linear theory."""

from dataclasses import replace

import numpy as np
import pytest

import controllers
from experiments import metrics_ideal
from experiments.metrics import Trial, score
from experiments.rollout import Episode, run
from steer_env.envs.layout import PERIOD, Truth
from steer_env.envs.task import Task, prepare
from steer_env.manoeuvres import MANOEUVRES, hand_at, kind_of
from steer_env.physics import linear
from steer_env.plants import PLANTS, Reference
from tests.experiments.trials import sine, trial


def driven(plant, causality, manoeuvre, law="pid", speed_kmh=75.0, driver="relaxed", linear_reference=False, **options):
    reference = Reference.load("published", linear_reference)
    task = Task(plant, causality, reference, None, None, manoeuvre, speed_kmh, driver, **options)
    made = plant if isinstance(plant, str) else plant.name
    controller = controllers.make(law, PLANTS[made], reference, causality, tuned=False)
    return Trial(run(task, controller, 0, 0.5), causality, linear_reference, manoeuvre)


def with_wet_friction(name):
    """A plant whose lower body has LuGre friction."""
    plant = PLANTS[name]
    return replace(plant, steering=plant.steering._replace(M_fric_extra=0.5, sigma_1=0.3))


@pytest.mark.parametrize("plant", ["EPAS", "SbW", with_wet_friction("EPAS")], ids=["EPAS", "SbW", "LuGre"])
@pytest.mark.parametrize("manoeuvre", ["on_centre_weave", "random_torque"])
def test_the_ideal_torque_is_what_the_environment_records_in_impedance(plant, manoeuvre):
    """Catches a wrong acceleration: forgotten friction, rack or motor, or a state that starts elsewhere."""
    episode = driven(plant, "impedance", manoeuvre, speed_kmh=(70.0, 80.0), duration=6.0).episode
    recorded = episode["reference"]
    error = metrics_ideal.ideal_torque(episode) - recorded
    # Friction is remade from one angle a period; the plant sees a reversal inside of it.
    assert np.sqrt(np.mean(error**2)) < 2e-3 * np.sqrt(np.mean(recorded**2))
    assert np.abs(error).max() < 0.03


def test_one_law_has_one_felt_torque_in_both_causalities():
    """The map on EPAS looks at no reference: the same run, judged by the record and by the compiled pass."""
    impedance, admittance = (driven("EPAS", c, "on_centre_weave", "open_loop_map") for c in controllers.CAUSALITIES)
    np.testing.assert_array_equal(impedance.achieved[1], admittance.achieved[1])
    mine, other = score(impedance), score(admittance)
    for name in ("felt_torque_error", "felt_torque_jnd", "felt_torque_p95", "passivity_gap_energy"):
        assert mine[name] == pytest.approx(other[name], rel=2e-3), name
    assert mine["tracking_relative"] == pytest.approx(0.15 * mine["felt_torque_jnd"], rel=1e-12)


@pytest.mark.parametrize("randomise", [(), ("car",)])
def test_the_car_at_the_true_angle_is_the_true_car(randomise):
    """Catches the reference's car in place of the one that is driven, and a speed that stands still."""
    options = {"speed_kmh": (60.0, 90.0), "duration": 5.0, "randomise": randomise}
    episode = driven("SbW", "admittance", "frequency_response", **options).episode
    found = metrics_ideal.car_acceleration(episode, episode["pinion_angle"])
    assert np.abs(found - episode["lateral_acceleration"]).max() < 1e-3 * np.abs(found).max()


def test_the_ideal_drive_is_linear_theory_where_all_is_linear():
    """Wheel and bar (Eq. 2) on Eq. 10 by their frequency responses, under the hand's torque alone."""
    plant = PLANTS["EPAS"]
    steering = plant.steering._replace(M_s_fric=0.0)
    task = Task(
        replace(plant, steering=steering), "admittance", linear=True, manoeuvre="random_torque", driver="torque_source",
        duration=8.0,
    )  # fmt: skip
    setup = prepare(task, np.random.default_rng(0), PERIOD)
    n = 14_000
    signals = np.zeros((n, len(Truth._fields)))
    signals[:, Truth._fields.index("speed")] = 75.0 / 3.6
    episode = Episode(setup, signals, True)
    found = metrics_ideal.ideal_drive(episode)

    kind, p = kind_of("random_torque"), episode.part("manoeuvre")
    hand = np.array([hand_at(kind, (k + 0.5) * PERIOD, p).torque for k in range(n)])
    f = np.fft.rfftfreq(n, PERIOD)
    s = 2j * np.pi * f
    reference = setup.reference.at(75.0 / 3.6)
    H = linear.frequency_response(linear.reference_matrices(75.0 / 3.6, reference, 1.0 + reference.k_gain), f)[:, 0, 0]
    bar = steering.c_tb + steering.b_tb * s
    wheel_per_torque = H + 1.0 / bar
    applied = steering.J_s * s * s + steering.b_s * s
    # Row k is the end of a period, through whose middle the hand torque acts.
    torque = np.fft.rfft(hand) * np.exp(0.5 * s * PERIOD) / (1.0 + applied * wheel_per_torque)
    pinion = np.fft.irfft(torque * H, n)
    wheel = np.fft.irfft(torque * wheel_per_torque, n)
    assert np.abs(found["pinion_angle"] - pinion).max() < 2e-4 * np.abs(pinion).max()
    assert np.abs(found["steering_angle"] - wheel).max() < 2e-4 * np.abs(wheel).max()


def test_in_admittance_the_car_follows_the_ideal_angle():
    """Half the angle for the same torque is half the lateral acceleration: twice the gradient, half the return."""
    x, _ = sine(21.5)
    torque = 8.0 * x + np.sign(np.gradient(x))
    signals = {"pinion_angle": 0.3 * x, "torsion_bar_torque": torque, "reference": 0.15 * x}
    driven_car = metrics_ideal.car_acceleration(trial("steady_state", "admittance", **signals).episode, 0.3 * x)
    found = score(trial("steady_state", "admittance", lateral_acceleration=driven_car, **signals))
    assert found["torque_gradient_0g_reference"] == pytest.approx(2.0 * found["torque_gradient_0g"], rel=1e-6)
    assert found["returnability_reference"] == pytest.approx(0.5 * found["returnability"], rel=1e-6)
    assert found["torque_0g_reference"] == pytest.approx(found["torque_0g"], rel=1e-6)
    assert found["average_stiffness_reference"] == pytest.approx(2.0 * found["average_stiffness"], rel=1e-6)


@pytest.mark.parametrize("plant", list(PLANTS))
def test_a_good_controller_comes_near_the_ideal_drive(plant):
    """The complete reference with friction and assist, arm and hand: within 2 % of what a controller achieves."""
    episode = driven(plant, "admittance", "steady_state").episode
    found = metrics_ideal.ideal_drive(episode)
    for name in ("pinion_angle", "steering_angle", "yaw_rate"):
        error = np.abs(found[name] - episode[name])
        assert np.sqrt(np.mean(error**2)) < 0.02 * np.sqrt(np.mean(found[name] ** 2)), name


def test_the_release_has_a_target():
    """The ideal comes to rest where friction holds it: no further than M_fric_C / c_pin_on, and soon."""
    found = score(driven("EPAS", "admittance", "release"))
    p = Reference.load("published").at(75.0 / 3.6)
    assert 0.0 < found["residual_angle_reference"] < np.degrees(p.M_fric_C / 35.5)
    assert found["settling_time_reference"] < 0.5
    assert 0.3 < found["yaw_damping_reference"] < 1.0
    assert found["residual_angle"] == pytest.approx(found["residual_angle_reference"], abs=0.5)


@pytest.mark.parametrize("causality", controllers.CAUSALITIES)
@pytest.mark.parametrize("manoeuvre", list(MANOEUVRES))
def test_no_metric_raises_on_a_short_or_idle_episode(manoeuvre, causality):
    """Warnings are errors here: catches a division by what an odd but legitimate episode leaves at zero."""
    for driver, amplitude, duration in (("relaxed", None, 0.3), ("relaxed", 0.0, 6.0), ("hands_off", None, 6.0)):
        options = {"driver": driver, "amplitude": amplitude, "duration": duration}
        found = score(driven("SbW", causality, manoeuvre, "open_loop_map", **options))
        assert all(isinstance(value, float) for value in found.values())
        assert np.isfinite(found["tracking_error"])
