"""Modes of plant, driver, control unit and controller together at rest, for a controller's design.

Friction sticks at rest: it is a spring of stiffness c_fric, the hardest case for a loop behind a
delay. experiments.robustness looks at the other operating points, and at margins.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments import linear_loop
from experiments.law_half import law_half
from experiments.operating_points import place_of
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.interface import Controller
from steer_env.plants import DRIVERS, PLANTS, Reference


def modes(task: Task, controller: Controller) -> NDArray[np.complex128]:
    """Modes of a task at constant speed in rad/s (growth + j frequency), fastest growing first.

    Integrators and drifts are left out; the manoeuvre does not matter.
    """
    plant = PLANTS[task.plant] if isinstance(task.plant, str) else task.plant
    driver = DRIVERS[task.driver] if isinstance(task.driver, str) else task.driver
    speed = task.speed_kmh if isinstance(task.speed_kmh, (int, float)) else task.speed_kmh[0]
    reference = Reference.load(task.reference, task.linear)
    place = place_of(plant, task.causality, reference, speed, "centre_stuck")
    controller.reset(PERIOD)
    environment = linear_loop.environment_half(place, [driver])
    return linear_loop.modes(linear_loop.closed_loop(environment, law_half(controller, place)))[0]
