"""Eigenvalues of plant, driver, control unit and controller together, one control period at a time.

The map from one period to the next is the program's own (``control_period`` and the law, as plain
Python), differentiated at rest with sensors that do not round: delays, filters, observer, reference
generator and controller are all in it. At rest friction sticks: it is a spring of stiffness c_fric,
the hardest case for a loop behind a delay. ``python -m experiments.coupled_stability`` prints the
slowest-decaying mode for every arm and speed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import controllers
from experiments.rollout import first_observation
from steer_env.envs import batch
from steer_env.envs.layout import LINE_LENGTH, LINES, PARAMETERS, PERIOD, STATE
from steer_env.envs.period import control_period, set_speed
from steer_env.envs.task import Task, prepare
from steer_env.interface import Controller, Observation

Array = NDArray[np.float64]

STEP = 1e-7  # of every state, in SI; far below what friction and assist need to leave their slope
PARTS = ("plant", "observer", "generator", "commands")
AT_REST = 0.5  # 1/s, modes slower than this are integrators and drifts (free angle, friction)
START = 2 * LINE_LENGTH  # the period that is differentiated; any will do


def period_map(task: Task, controller: Controller) -> tuple[Callable[[Array], Array], int]:
    """(function from the deviation from rest of one period to that of the next, its length)."""
    setup = prepare(task, np.random.default_rng(0), PERIOD)
    row, speed = setup.row, first_observation(setup).speed
    blank = {"angle_step": 0.0, "angle_noise": 0.0, "torque_step": 0.0, "torque_noise": 0.0}
    row[PARAMETERS["sensors"]] = PARAMETERS.read(row, "sensors")._replace(**blank)
    rest = batch.new_rows(1)[1][0]
    clock = STATE["clock"].start
    rest[clock : clock + 2] = START, speed
    set_speed(speed, row, rest, setup.table, setup.car_table)
    controller.reset(PERIOD)
    law, parameters = controller.law, controller.parameters
    leaves, rebuild = _flat(controller.state())
    seen = np.array(first_observation(setup))
    kept = np.concatenate(
        [*(np.r_[STATE[part]] for part in PARTS), [STATE.column("clock", "last_reference")]]
    )
    ages = (START - 1 - np.arange(LINE_LENGTH)) % LINE_LENGTH
    cuts = np.cumsum([kept.size, len(LINES) * LINE_LENGTH, len(leaves)])

    def advance(deviation: Array) -> Array:
        inner, past, memory, view = np.split(deviation, cuts)
        states, lines = rest.copy(), np.zeros((len(LINES), LINE_LENGTH))
        states[kept] += inner
        lines[:, ages] = past.reshape(lines.shape)
        observation = Observation(*(seen + view).tolist())
        command, state = law(observation, rebuild(memory.tolist()), parameters)
        after, _ = control_period(
            command, 0.0, 0.0, row, states, lines, setup.table, setup.car_table
        )
        past = lines[:, (ages + 1) % LINE_LENGTH].ravel()
        return np.concatenate([states[kept] - rest[kept], past, _flat(state)[0], after - seen])

    return advance, int(cuts[-1]) + seen.size


def modes(task: Task, controller: Controller) -> NDArray[np.complex128]:
    """Modes in rad/s (growth + j frequency), fastest growing first, integrators left out."""
    advance, size = period_map(task, controller)
    start = advance(np.zeros(size))
    columns = [(advance(STEP * unit) - start) / STEP for unit in np.eye(size)]
    values = np.linalg.eigvals(np.column_stack(columns))
    rates = np.log(values[np.abs(values) > 1e-6].astype(complex)) / PERIOD
    rates = rates[(rates.imag >= 0.0) & (np.abs(rates) > AT_REST)]
    return rates[np.argsort(-rates.real)]


def _flat(record: Any) -> tuple[list[float], Callable[[list[float]], Any]]:
    """(Numbers of a nested NamedTuple, function that puts such numbers back into its shape)."""
    leaves = [
        leaf
        for value in record
        for leaf in (_flat(value)[0] if isinstance(value, tuple) else [float(value)])
    ]

    def rebuild(numbers: list[float]) -> Any:
        supply = iter(numbers)
        return _filled(record, lambda: next(supply))

    return leaves, rebuild


def _filled(record: Any, supply: Callable[[], float]) -> Any:
    """A record of the same shape whose numbers come from ``supply`` one after the other."""
    values = [_filled(v, supply) if isinstance(v, tuple) else supply() for v in record]
    return type(record)(*values)


def main() -> None:
    """Print the fastest growing mode of every controller, plant, causality, speed and arm."""
    from steer_env.plants import DRIVERS, PLANTS, Reference

    for linear in (False, True):
        reference = Reference.load("published", linear)
        speeds = [row.speed_kmh for row in reference.file.rows]
        for name in controllers.CONTROLLERS:
            for plant in PLANTS.values():
                for causality in controllers.CAUSALITIES:
                    kind = "linear" if linear else "friction stuck"
                    print(f"\n{name}, {plant.name}, {causality}, {kind}: growth [1/s] @ [rad/s]")
                    for arm in DRIVERS:
                        cells = []
                        for speed in speeds:
                            task = Task(
                                plant, causality, reference, linear, None, "standstill", speed, arm
                            )
                            law = controllers.make(name, plant, reference, causality)
                            mode = modes(task, law)[0]
                            cells.append(f"{mode.real:7.1f} @{mode.imag:4.0f}")
                        print(f"{arm:15s}" + " ".join(cells))


if __name__ == "__main__":
    main()
