"""The laws that close a loop on the reference, besides pid: stable in the small, and each one's own promise."""

from dataclasses import replace
from itertools import product

import pytest

import controllers
from controllers import CAUSALITIES, CONTROLLERS
from experiments import coupled_stability
from experiments.measures import rms
from experiments.rollout import run
from steer_env.envs.task import Task
from steer_env.plants import DRIVERS, PLANTS, Reference

LAWS = [name for name in CONTROLLERS if name not in ("open_loop_map", "pid")]


@pytest.mark.parametrize(("name", "plant", "causality"), list(product(LAWS, PLANTS, CAUSALITIES)))
@pytest.mark.parametrize(("speed_kmh", "linear"), [(45.0, False), (75.0, True), (105.0, False)])
def test_stable_in_the_small_with_every_arm(name, plant, causality, speed_kmh, linear):
    """Eigenvalues of the whole loop, friction stuck or absent: catches a gain set for one arm."""
    reference = Reference.load("published", linear)
    law = controllers.make(name, PLANTS[plant], reference, causality)
    for arm in DRIVERS:
        task = Task(plant, causality, reference, linear, None, "standstill", speed_kmh, arm)
        fastest = coupled_stability.modes(task, law)[0]
        assert fastest.real < 0.0, f"{arm}: grows with {fastest}"


@pytest.mark.parametrize("causality", CAUSALITIES)
def test_the_disturbance_observer_takes_off_what_the_model_does_not_know(causality):
    """Hardware with twice the friction and damping that the design was told: catches a Q of the wrong sign or age."""
    nominal = PLANTS["EPAS"]
    worn = nominal.steering._replace(M_fric=2.0 * nominal.steering.M_fric, b_pin=2.0 * nominal.steering.b_pin)
    reference = Reference.load("published")
    task = Task(replace(nominal, steering=worn), causality, reference, manoeuvre="steady_state", duration=10.0)

    def error(**gains):
        law = controllers.make("disturbance_observer", nominal, reference, causality, **gains)
        return rms(run(task, law, seed=1)["error"])

    assert error() < 0.6 * error(q_bandwidth=0.0)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_no_corner_is_the_end_of_smaller_and_smaller_ones(plant):
    """The integral without weight has no least cost; its range has 0 in it, which must mean no integral."""
    without, hardly = (
        with_period(controllers.make("lqg", plant, Reference.load("published"), "impedance", corner=corner))
        for corner in (0.0, 1e-4)
    )
    assert without.K_integral == 0.0
    for name in ("K_twist", "K_rate", "K_motor"):
        assert getattr(without, name) == pytest.approx(getattr(hardly, name), rel=1e-4), name


def with_period(controller):
    controller.reset(1e-3)
    return controller.parameters
