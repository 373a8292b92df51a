"""The loop as two linear halves, each the program's own function differentiated at an operating point.

Environment (``control_period`` behind ``step_batch``, here): torque target of the motor and torque of
the hand in, what the control unit measures out. Law (experiments.law_half): what is measured in,
target out. The law's half also keeps the last four commands, which it sees as ``last_torque_1`` to
``_4``: so the loop opens between control unit and motor, where a motor's gain error or more dead time
sits. The environment's half depends on the arm and not on the controller, the law's the other way
round. The torque that the control unit counts as its motor's is the true one, as in the program.

All is in periods of PERIOD s: x+ = A x + B u, y = C x + D u, and z = exp(j w PERIOD).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.operating_points import CLOCK, Place, held_torque, with_arms
from steer_env.envs import batch
from steer_env.envs.layout import LINE_LENGTH, LINES, PARAMETERS, PERIOD, STATE, Truth
from steer_env.interface import Observation
from steer_env.physics.driver import Driver

Array = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MEASURED = tuple(name for name in Observation._fields if name != "speed" and not name.startswith("last_torque"))
MOTOR, HAND = 0, 1  # inputs of the environment
PORTS = slice(len(MEASURED), None)  # its last outputs: what an impedance is made of
PORT_NAMES = ("steering_rate", "pinion_rate", "torsion_bar_torque")
WHEEL_RATE, PINION_RATE, BAR_TORQUE = range(3)  # among them
COMMANDS = 4  # periods of commands that a law sees
ANGLE_STEP, STEP = 1e-7, 1e-5  # rad and any other unit: far below what friction and assist bend over
AT_REST = 0.5  # 1/s: slower modes are integrators, drifts and friction's memory
PARTS = ("plant", "observer", "generator")


class Half(NamedTuple):
    """Matrices of one half; the environment's have a leading axis over arms."""

    A: Array
    B: Array
    C: Array
    D: Array


def environment_half(
    place: Place, arms: Sequence[Driver], parts: Sequence[str] = PARTS, truths: Sequence[str] = PORT_NAMES
) -> Half:
    """Environments [m] with the given arms: inputs MOTOR and HAND, outputs MEASURED and then PORTS.

    States: plant, observer, generator (``parts``), the unit's last reference, and what the delay lines
    still have to give (``delayed``). ``truths`` names other last outputs than PORTS.
    """
    parameters = with_arms(place, arms)
    columns = np.array([i for part in parts for i in range(STATE[part].start, STATE[part].stop)])
    names = [name for part in parts for name in STATE.records[part]._fields]
    columns = np.append(columns, STATE.column("clock", "last_reference"))
    memory = delayed(place)
    names += ["last_reference_angle", *(LINES[line] for line, _ in memory)]
    steps = np.array([ANGLE_STEP if "angle" in name else STEP for name in names] + [STEP, STEP])
    n, inputs = len(names), len(names) + 2

    # Every arm meets every variable a step up and a step down: [arm, variable, sign].
    shape = (len(arms), inputs, 2)
    rows = np.ascontiguousarray(np.broadcast_to(parameters[:, None, None], (*shape, parameters.shape[1])))
    states = np.broadcast_to(place.state, (*shape, place.state.size)).copy()
    lines = np.broadcast_to(place.lines, (*shape, *place.lines.shape)).copy()
    target = place.observation.last_torque_1
    commands = np.full(shape, target)
    for sign in (0, 1):
        moved = steps * (1.0 - 2.0 * sign)
        for j, column in enumerate(columns):
            states[:, j, sign, column] += moved[j]
        for j, (line, age) in enumerate(memory, len(columns)):
            lines[:, j, sign, line, (CLOCK - age) % LINE_LENGTH] += moved[j]
        commands[:, n + MOTOR, sign] += moved[n + MOTOR]
        amplitude = PARAMETERS.column("manoeuvre", "amplitude")
        rows[:, n + HAND, sign, amplitude] += moved[n + HAND] / held_torque(parameters[0])

    seen, really = _one_period(commands, rows, states, lines, place)
    measured = [Observation._fields.index(name) for name in MEASURED]
    ports = [Truth._fields.index(name) for name in truths]
    outputs = np.concatenate([seen[..., measured], really[..., ports]], axis=-1)
    kept = [states[..., columns]]
    kept += [lines[..., line, (CLOCK + 1 - age) % LINE_LENGTH][..., None] for line, age in memory]
    after = np.concatenate([*kept, outputs], axis=-1)
    slopes = (after[:, :, 0] - after[:, :, 1]) / (2.0 * steps[:, None])
    slopes = np.swapaxes(slopes, 1, 2)
    return Half(slopes[:, :n, :n], slopes[:, :n, n:], slopes[:, n:, :n], slopes[:, n:, n:])


def closed_loop(environment: Half, law: Half, gain: complex = 1.0) -> Half:
    """The loop: the hand's torque in, PORTS out; ``gain`` is a factor on the motor's target."""
    E, u, y = environment, gain * law.C, slice(0, len(MEASURED))
    upper = np.concatenate([E.A, E.B[:, :, :HAND] @ u], axis=2)
    lower = np.concatenate([law.B @ E.C[:, y], law.A + law.B @ E.D[:, y, :HAND] @ u], axis=2)
    return Half(
        np.concatenate([upper, lower], axis=1),
        np.concatenate([E.B[:, :, HAND:], law.B @ E.D[:, y, HAND:]], axis=1),
        np.concatenate([E.C[:, PORTS], E.D[:, PORTS, :HAND] @ u], axis=2),
        E.D[:, PORTS, HAND:],
    )


def loop_response(environment: Complexes, law: Complexes) -> Complexes:
    """L [f] with 1 + L the loop's return difference, of the responses [f, y, u] of both halves."""
    return -np.sum(law[:, 0, :] * environment[:, : len(MEASURED), MOTOR], axis=1)


def impedances(ports: Complexes, omega: Array) -> tuple[Complexes, Complexes]:
    """(Hand torque over wheel rate, torsion-bar torque over pinion rate) in N m s/rad at omega [f] in rad/s.

    ``ports`` [f, PORTS, 1] is the loop's response to the hand's torque, which is held over a period, and the rate is
    seen at its end; what that does to size and phase is taken out.
    """
    held = np.exp(0.5j * omega * PERIOD) * np.sinc(0.5 * omega * PERIOD / np.pi)
    return held / ports[:, WHEEL_RATE, 0], ports[:, BAR_TORQUE, 0] / ports[:, PINION_RATE, 0]


def first_of(half: Half) -> Half:
    """The first of the loops in ``half``."""
    return Half(*(matrix[0] for matrix in half))


def modes(half: Half) -> list[Complexes]:
    """Modes of each of the loops [m] in rad/s, growth + j frequency, fastest growing first.

    Left out are modes slower than AT_REST, what is gone within a period, and states that never reach
    the wheel (a reference that the law does not look at).
    """
    felt = np.abs(half.C[:, WHEEL_RATE]).max(axis=0) > 0.0
    paths = np.abs(half.A).max(axis=0) > 0.0  # [to, from]
    while True:
        more = felt | paths[felt].any(axis=0)
        if (more == felt).all():
            break
        felt = more
    found = []
    for values in np.linalg.eigvals(half.A[:, felt][:, :, felt]):
        rates = np.log(values[np.abs(values) > 1e-6].astype(complex)) / PERIOD
        rates = rates[(rates.imag >= 0.0) & (np.abs(rates) > AT_REST)]
        found.append(rates[np.argsort(-rates.real)])
    return found


def response(half: Half, omega: Array) -> Complexes:
    """C (z - A)^-1 B + D of one half at omega [f] in rad/s, as [f, outputs, inputs]."""
    A, B, C, D = half
    z = np.exp(1j * omega * PERIOD)[:, None, None]
    inputs = np.broadcast_to(B, (omega.size, *B.shape)).astype(complex)
    return np.asarray(C @ np.linalg.solve(z * np.eye(len(A)) - A, inputs) + D, dtype=complex)


def delayed(place: Place) -> list[tuple[int, int]]:
    """(Line, age in periods) of what the delay lines still have to give."""
    motor, sensors = PARAMETERS.read(place.parameters, "motor"), PARAMETERS.read(place.parameters, "sensors")
    delays = (motor.dead_time, sensors.angle_delay, sensors.torque_delay, sensors.angle_delay)
    return [(line, age) for line, delay in enumerate(delays) for age in range(1, int(delay) + 1)]


def _one_period(commands: Array, rows: Array, states: Array, lines: Array, place: Place) -> tuple[Array, Array]:
    """Run one noise-free period of all; rows change in place; (observations [..., 13], truths [..., t])."""
    n = commands.size
    observations, truths = np.zeros((n, len(Observation._fields))), np.zeros((n, len(Truth._fields)))
    batch.step_batch(
        commands.reshape(n), np.zeros((n, 2)), rows.reshape(n, -1), states.reshape(n, -1),
        lines.reshape(n, *lines.shape[-2:]), place.table, place.car_table, np.ones_like(observations),
        observations, np.zeros(observations.shape, np.float32), truths,
    )  # fmt: skip
    return observations.reshape(*commands.shape, -1), truths.reshape(*commands.shape, -1)
