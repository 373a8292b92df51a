"""From weights to a sampled controller of few states for h_infinity, and what gamma is left at each step."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from controllers.h_infinity_plant import DISTURBANCES, RESULTS, Felt, Ports, Weights, delay, ports, problem
from controllers.schedule import Felt as Row
from controllers.synthesis import Complexes, Matrix, bilinear, closed, peak, response, synthesise, truncated
from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Sensors
from steer_env.physics.steering import Steering
from steer_env.plants import Plant
from steer_env.units import Quantity

ORDER = 10  # states of the law
ANGLE_SIZE, TORQUE_SIZE = 1e-4, 0.02  # rad, N m: errors that count like 1 N m of the motor in the truncation


class Achieved(NamedTuple):
    """Gamma is 1 where all weights are just met; infinite where the loop is unstable."""

    gamma: Annotated[float, Quantity("-", "bound of the synthesis", 0.0, 1e4, "synthesis")]
    gamma_full: Annotated[float, Quantity("-", "of all states, on a grid", 0.0, np.inf, "computed")]
    gamma_reduced: Annotated[float, Quantity("-", "of the law's states, on a grid", 0.0, np.inf, "computed")]
    gamma_sampled: Annotated[float, Quantity("-", "the same sampled, with the true delay", 0.0, np.inf, "computed")]
    arm: Annotated[float, Quantity("-", "stable with every arm while below 1", 0.0, np.inf, "computed")]
    order_full: Annotated[float, Quantity("-", "states of the synthesised controller", 1, 100, "synthesis")]
    order: Annotated[float, Quantity("-", "states of the law", 1, 100, "computed")]
    truncation: Annotated[float, Quantity("-", "bound of what truncation changes", 0.0, np.inf, "computed")]


class Sampled(NamedTuple):
    """The law's matrices (synthesis.bilinear) and what they achieve."""

    step: Matrix
    output: Matrix
    achieved: Achieved


def felt_of(schedule: Matrix) -> Felt:
    """The reference that the design counts with: the median over the rows of ``schedule_of``."""
    rows = [Row(*row[1:].tolist()) for row in schedule]
    damping, stiffness = zip(*((r.b_ref / r.J_ref, r.stiffness / r.J_ref) for r in rows), strict=True)
    return Felt(float(np.median(damping)), float(np.median(stiffness)))


def designed(plant: Plant, felt: Felt, weights: Weights, impedance: bool, leak: float, period: float) -> Sampled:
    """The sampled controller for a plant; kept for equal numbers."""
    return _designed(
        plant.steering, plant.motor, plant.sensors, plant.rack_share, felt, weights, impedance, leak, period
    )


@lru_cache(maxsize=64)
def _designed(
    steering: Steering,
    motor: Motor,
    sensors: Sensors,
    rack_share: float,
    felt: Felt,
    weights: Weights,
    impedance: bool,
    leak: float,
    period: float,
) -> Sampled:
    plant = Plant("", steering, motor, sensors, rack_share, 1.0)
    open_ports = ports(plant, felt, weights, impedance, leak)
    q = problem(open_ports, delay(plant, period) + weights.late)
    full, gamma = synthesise(q)
    scale = np.array([1.0, ANGLE_SIZE, TORQUE_SIZE])
    reduced, values = truncated(full, ORDER, scale)
    step, output = bilinear(reduced, period)
    omega = np.geomspace(0.01, np.pi / period, 500)
    sampled = sampled_response(open_ports, step, output, plant, period, omega)
    A = closed(q, reduced)[0]
    stable = np.linalg.eigvals(A).real.max() < 0.0
    settles = growth(open_ports, step, output, plant, period) < 1.0
    arm = sampled[:, RESULTS.index("arm"), DISTURBANCES.index("hand")]
    achieved = Achieved(
        gamma=gamma,
        gamma_full=peak(response(*closed(q, full), omega)),
        gamma_reduced=peak(response(*closed(q, reduced), omega)) if stable else np.inf,
        gamma_sampled=peak(sampled) if settles else np.inf,
        arm=float(np.abs(arm).max()),
        order_full=float(len(full.A)),
        order=float(len(reduced.A)),
        truncation=2.0 * float(values[len(reduced.A) :].sum()),
    )
    return Sampled(*_padded(step, output), achieved)


def _padded(step: Matrix, output: Matrix) -> tuple[Matrix, Matrix]:
    """The same with ORDER states, those beyond its own being zero."""
    n = len(step)
    wide, long = np.zeros((ORDER, ORDER + 3)), np.zeros(ORDER + 3)
    wide[:n, :n], wide[:n, ORDER:] = step[:, :n], step[:, n:]
    long[:n], long[ORDER:] = output[:n], output[n:]
    return wide, long


def delayed(plant: Plant, period: float) -> int:
    """Whole periods between a sensor's sample and the command that answers it."""
    return round(delay(plant, period) / period - 0.5)


def sampled_response(
    p: Ports, step: Matrix, output: Matrix, plant: Plant, period: float, omega: NDArray[np.float64]
) -> Complexes:
    """From disturbances to results [f, 4, 4] with the sampled law, the whole delay and the hold, at omega [f] in rad/s."""
    n = len(step)
    s, z = 1j * omega[:, None, None], np.exp(1j * omega * period)[:, None, None]
    P = p.C @ np.linalg.solve(s * np.eye(len(p.A)) - p.A, np.broadcast_to(p.B, (omega.size, *p.B.shape))) + p.D
    own = step[:, :n] + np.outer(step[:, n], output[:n])
    enter = step[:, n + 1 :] + np.outer(step[:, n], output[n + 1 :])
    law = output[:n] @ np.linalg.solve(z * np.eye(n) - own, np.broadcast_to(enter, (omega.size, *enter.shape)))
    half = 0.5 * omega * period
    back = np.zeros((omega.size, 2, 3), dtype=complex)  # (error, forward, ordered) to (v, arrived)
    back[:, 0, :2] = law + output[n + 1 :]
    back[:, 1, 2] = np.exp(-1j * omega * period * delayed(plant, period) - 1j * half) * np.sinc(half / np.pi)
    inner = np.linalg.solve(np.eye(2) - back @ P[:, 4:, 4:], back @ P[:, 4:, :4])
    return np.asarray(P[:, :4, :4] + P[:, :4, 4:] @ inner, dtype=complex)


def growth(p: Ports, step: Matrix, output: Matrix, plant: Plant, period: float) -> float:
    """Largest size of an eigenvalue of the sampled loop, weights aside: stable below 1."""
    n, m, late = len(p.A), len(step), delayed(plant, period)
    both = expm(period * np.block([[p.A, p.B[:, 5:]], [np.zeros((1, n + 1))]]))
    y, ordered = slice(4, 6), slice(6, 7)
    # States: ports, the law's, torques under way (newest first).
    size = n + m + late
    v, new = np.zeros(size), np.zeros(size)
    v[:n], v[n : n + m] = output[m + 1 :] @ p.C[y], output[:m]
    new[:] = v
    new[:n] += p.C[ordered][0]
    A = np.zeros((size, size))
    A[:n, :n] = both[:n, :n]
    A[:n] += np.outer(both[:n, n], new if late == 0 else np.eye(size)[-1])
    A[n : n + m, n : n + m] = step[:, :m]
    A[n : n + m, :n] = step[:, m + 1 :] @ p.C[y]
    A[n : n + m] += np.outer(step[:, m], v)
    if late:
        A[n + m] = new
        A[n + m + 1 :, n + m : -1] = np.eye(late - 1)
    return float(np.abs(np.linalg.eigvals(A)).max())
