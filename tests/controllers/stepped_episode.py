"""An episode in plain steps, against which a compiled rollout is held."""

from collections.abc import Callable

import numpy as np

from experiments.rollout import first_observation, run
from steer_env.envs import batch
from steer_env.envs.layout import PERIOD
from steer_env.envs.period import control_period
from steer_env.envs.task import Task, prepare


def assert_steps_are_the_rollout(controller, task: Task, watch: Callable[[], None] = lambda: None) -> None:
    """Step by step the controller's own call gives every bit of the compiled rollout's signals.

    ``watch`` is called after each of its calls.
    """
    episode = run(task, controller, seed=3)
    rng = np.random.default_rng(3)
    setup = prepare(task, rng, PERIOD)
    noise = rng.standard_normal((setup.periods, 2))
    parameters, states, lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, states, lines, setup.table, setup.car_table)
    observation = first_observation(setup)
    controller.reset(PERIOD)
    for k in range(setup.periods):
        command = controller(observation)
        watch()
        observation, truth = control_period(
            command, *noise[k].tolist(), parameters[0], states[0], lines[0],
            setup.table, setup.car_table,
        )  # fmt: skip
        assert tuple(episode.signals[k].tolist()) == tuple(map(float, truth)), f"period {k}"
