"""How good any controller could get: python -m experiments.limit.

Given what cannot be changed (delays, the motor's lag and torque limit, the sensors' noise and steps,
a hand that nobody can foresee), the least tracking error of a controller that knows plant, arm and
reference exactly. With the linear reference and sliding friction the loop is linear, and the least
mean square error is that of the LQG optimum: state feedback and Kalman filter from two Riccati
equations. It counts no friction and no non-linear assist, so what a real loop reaches lies above it.

The hand's torque is noise, flat up to HAND_HZ and falling beyond (the band in which responses are scored,
all of it excited at once), with the rms of the random_torque manoeuvre. Effort is weighted only so far that three
times the motor's rms torque stays inside its rating. Each controller's error is that of its own
linear loop under the same hand and the same noise, from a Lyapunov equation: its distance to the
limit is the ratio of the two. Errors are in JND: 15 % of the reference's own rms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov
from scipy.signal import cont2discrete

import controllers
from experiments.bench_cases import Maker
from experiments.bench_systems import SYSTEMS, System
from experiments.law_half import has_law, law_half, periods_in_step
from experiments.linear_loop import HAND, MEASURED, MOTOR, PARTS, Half, delayed, environment_half
from experiments.measures import JND
from experiments.operating_points import Place, place_of
from steer_env.envs.layout import LINES, PERIOD
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics.driver import Driver
from steer_env.plants import DRIVERS, PLANTS, Plant, Reference

Array = NDArray[np.float64]

HAND_HZ = 5.0  # the highest frequency that is scored
ARMS = ("one_hand_light", "relaxed", "tense")
TRUTHS = ("error", "reference", "motor_torque")
ERROR, WANTED, MOTOR_TORQUE = range(3)
EFFORTS = np.geomspace(1e-6, 1e2, 9)  # weight of the motor's share of its rating, beside the error in JND
SIGMAS = 3.0  # the motor's rms torque times this has to stay inside its rating
# A little of every state's own noise: without any, what noise never reaches makes the equations singular.
TINY = 1e-12


class Problem(NamedTuple):
    """Linear loop without a controller: x+ = A x + B u + G w, truths z = C x, measured y = S x + v.

    ``w`` is white with unit variance (hand, then the noise of torque and angle that enters the delay
    lines); ``rating`` in N m at the motor. States: environment, then the hand's spectrum. ``observed`` is what
    a law sees (MEASURED).
    """

    environment: Half
    A: Array
    B: Array
    G: Array
    C: Array
    S: Array
    observed: Array
    rating: float


class Limit(NamedTuple):
    """The least error at one place, and what controllers reach there; all in JND of the reference."""

    plant: str
    causality: str
    speed_kmh: float
    arm: str
    limit_jnd: float
    motor_share: float
    reached: dict[str, float | None]


def limits(
    names: Sequence[str],
    reference: Reference,
    speeds_kmh: Sequence[float],
    makers: Mapping[str, Maker] | None = None,
    arms: Sequence[str] = ARMS,
    systems: Sequence[System] = SYSTEMS,
) -> list[Limit]:
    """Limit and what controllers reach, on each system; None where a loop is unstable.

    A policy is left out: its correction bends and its base law's integral waits while the correction is large, so what
    its loop does about one point says little of its error (in simulation a third of what that point promised).
    """
    linear, own = Reference.load(reference, True), makers or {}
    found = []
    for plant, causality in systems:
        made = {
            name: (own.get(name) or partial(controllers.make, name))(PLANTS[plant], linear, causality) for name in names
        }
        for speed, arm in product(speeds_kmh, arms):
            place = place_of(PLANTS[plant], causality, linear, speed, "centre_sliding")
            problem = problem_of(place, DRIVERS[arm], PLANTS[plant])
            least, share = optimum(problem)
            reached = {
                name: reached_by(problem, law_half(controller, place))
                for name, controller in made.items()
                if has_law(controller) and periods_in_step(controller) == 1
            }
            found.append(Limit(plant, causality, float(speed), arm, least, share, reached))
    return found


def problem_of(place: Place, arm: Driver, hardware: Plant) -> Problem:
    """The loop at a place with an arm; the sensors of ``hardware`` must be a period late or more."""
    environment = environment_half(place, [arm], (*PARTS, "judge"), TRUTHS)
    A, B, C, D = (matrix[0] for matrix in environment)
    n, memory = len(A), delayed(place)
    first = n - len(memory)  # what the delay lines hold comes last
    sensors = hardware.sensors
    angle, torque = LINES.index("angle"), LINES.index("torque")
    F, g, h = hand_spectrum()
    m = len(F)
    wide = np.block([[A, B[:, HAND, None] * h], [np.zeros((m, n)), F]])
    drive = np.vstack([B[:, MOTOR, None], np.zeros((m, 1))])
    noise = np.zeros((n + m, 3))
    noise[n:, 0] = g
    seen = np.zeros((2, n + m))
    for row, (line, rms, step, late) in enumerate(
        (
            (torque, sensors.torque_noise, sensors.torque_step, sensors.torque_delay),
            (angle, sensors.angle_noise, sensors.angle_step, sensors.angle_delay),
        )
    ):
        noise[first + memory.index((line, 1)), 1 + row] = np.hypot(rms, step / np.sqrt(12.0))
        seen[row, first + memory.index((line, int(late)))] = 1.0
    outputs = np.hstack([C, D[:, HAND, None] * h])
    observed, truths = np.split(outputs, [len(MEASURED)])
    return Problem(environment, wide, drive, noise, truths, seen, observed, hardware.motor.rated_torque)


def hand_spectrum() -> tuple[Array, Array, Array]:
    """(F [m, m], g [m], h [m]) of the hand's torque h x in N m with x+ = F x + g w, w white."""
    A, B, C, D = butter_states()
    F, G, h, _, _ = cont2discrete((A, B, C, D), PERIOD)
    rms = 0.5 * MANOEUVRES["random_torque"].parameters.amplitude
    variance = float((h @ solve_discrete_lyapunov(F, G @ G.T) @ h.T)[0, 0])
    return np.asarray(F), np.asarray(G[:, 0]) * rms / np.sqrt(variance), np.asarray(h[0])


def butter_states() -> tuple[Array, Array, Array, Array]:
    """A second-order Butterworth low-pass in state space, its states a torque and its rate over the corner."""
    w = 2.0 * np.pi * HAND_HZ
    A = w * np.array([[0.0, 1.0], [-1.0, -np.sqrt(2.0)]])
    return A, w * np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))


def optimum(problem: Problem) -> tuple[float, float]:
    """(Least rms error in JND, rms motor torque over its rating) of the LQG optimum."""
    A, B, G, S = problem.A, problem.B, problem.G, problem.S
    scale = _wanted_rms(problem)
    weight = problem.C[ERROR] / (JND * scale)
    noise = G @ G.T + TINY * np.eye(len(A))
    # The delay lines hold the sensors' noise already: y = S x is exact up to rounding.
    Y = solve_discrete_are(A.T, S.T, noise, TINY * np.eye(2))
    gain = A @ Y @ S.T @ np.linalg.inv(S @ Y @ S.T + TINY * np.eye(2))
    best = (np.inf, np.inf)
    for effort in EFFORTS:
        R = np.array([[effort / problem.rating**2]])
        X = solve_discrete_are(A, B, np.outer(weight, weight) + TINY * np.eye(len(A)), R)
        K = np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
        closed = np.block([[A, -B @ K], [gain @ S, A - B @ K - gain @ S]])
        P = solve_discrete_lyapunov(closed, _stacked(G))
        n = len(A)
        wanted = float(np.sqrt(problem.C[WANTED] @ P[:n, :n] @ problem.C[WANTED]))
        error = float(np.sqrt(problem.C[ERROR] @ P[:n, :n] @ problem.C[ERROR])) / (JND * wanted)
        share = float(np.sqrt(problem.C[MOTOR_TORQUE] @ P[:n, :n] @ problem.C[MOTOR_TORQUE])) / problem.rating
        if SIGMAS * share <= 1.0 and error < best[0]:
            best = error, share
    return best


def reached_by(problem: Problem, law: Half) -> float | None:
    """Rms error in JND of a law's linear loop under the same hand and noise; None where it is unstable."""
    n, m = len(problem.A), len(law.A)
    through = problem.environment.D[0, : len(MEASURED), MOTOR, None]
    closed = np.block(
        [[problem.A, problem.B @ law.C], [law.B @ problem.observed, law.A + law.B @ through @ law.C]]
    )
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
        return None
    noise = np.zeros((n + m, n + m))
    noise[:n, :n] = problem.G @ problem.G.T
    P = solve_discrete_lyapunov(closed, noise)[:n, :n]
    ratio = (problem.C[ERROR] @ P @ problem.C[ERROR]) / (problem.C[WANTED] @ P @ problem.C[WANTED])
    return float(np.sqrt(ratio)) / JND


def _wanted_rms(problem: Problem) -> float:
    """Rms of the reference with the motor off, to scale the error with; 1 where that loop does not settle."""
    if np.abs(np.linalg.eigvals(problem.A)).max() >= 1.0:
        return 1.0
    P = solve_discrete_lyapunov(problem.A, problem.G @ problem.G.T)
    return float(np.sqrt(problem.C[WANTED] @ P @ problem.C[WANTED]))


def _stacked(G: Array) -> Array:
    """Noise of (state, estimate): the estimate gets none of its own."""
    n = len(G)
    both = np.zeros((2 * n, 2 * n))
    both[:n, :n] = G @ G.T
    return both


def as_records(found: Sequence[Limit]) -> list[dict[str, Any]]:
    """Plain values for scores.json."""
    return [one._asdict() for one in found]


def main() -> None:
    """Print limit and what every controller reaches, at 75 km/h."""
    from experiments.cli_options import print_table

    names = list(controllers.CONTROLLERS)
    found = limits(names, Reference.load("published"), (75.0,))
    rows: list[list[object]] = [
        [f.plant, f.causality, f.arm, f"{f.limit_jnd:.3f}", f"{f.motor_share:.2f}",
         *("unstable" if f.reached[n] is None else f"{f.reached[n]:.2f}" for n in names)]
        for f in found
    ]  # fmt: skip
    print_table(["plant", "causality", "arm", "limit [JND]", "motor", *names], rows, title="rms error at 75 km/h, JND")


if __name__ == "__main__":
    main()
