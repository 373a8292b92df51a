"""From weights to a sampled controller of few states for h_infinity, and the gamma that is left at each step."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from controllers.h_infinity_plant import DISTURBANCES, RESULTS, Felt, Ports, Weights, delay, ports, problem
from controllers.synthesis import Complexes, Matrix, bilinear, closed, peak, response, synthesise, truncated
from steer_env.physics.motor import Motor
from steer_env.physics.sensors import Sensors
from steer_env.physics.steering import Steering
from steer_env.plants import Plant
from steer_env.units import Quantity

ORDER = 10  # states of the law
# rad and N m: what counts like 1 N m of the motor when states are left out.
ANGLE_SIZE, TORQUE_SIZE = 1e-4, 0.02
SLOWEST, POINTS = 0.01, 500  # rad/s, frequencies up to half the sampling frequency at which gamma is looked at


class Achieved(NamedTuple):
    """Gamma is 1 where all weights are just met; infinite where the loop is unstable."""

    gamma: Annotated[float, Quantity("-", "bound of the synthesis", 0.0, 1e4, "synthesis")]
    gamma_full: Annotated[float, Quantity("-", "of all states, on a grid", 0.0, np.inf, "computed")]
    gamma_reduced: Annotated[float, Quantity("-", "of the law's states, on a grid", 0.0, np.inf, "computed")]
    gamma_sampled: Annotated[float, Quantity("-", "sampled, with the true delay and hold", 0.0, np.inf, "computed")]
    arm: Annotated[float, Quantity("-", "stable with every arm while below 1", 0.0, np.inf, "computed")]
    order_full: Annotated[float, Quantity("-", "states of the synthesised controller", 1, 100, "synthesis")]
    order: Annotated[float, Quantity("-", "states of the law", 1, 100, "computed")]
    truncation: Annotated[float, Quantity("-", "bound of what truncation changes", 0.0, np.inf, "computed")]


class Sampled(NamedTuple):
    """The law's matrices (synthesis.bilinear, ORDER states) and what they achieve."""

    step: Matrix
    output: Matrix
    achieved: Achieved


def designed(plant: Plant, felt: Felt, weights: Weights, leak: float, period: float) -> Sampled:
    """The sampled controller for a plant; found once for equal numbers."""
    return _designed(plant.steering, plant.motor, plant.sensors, plant.rack_share, felt, weights, leak, period)


@lru_cache(maxsize=64)
def _designed(
    steering: Steering, motor: Motor, sensors: Sensors, rack_share: float,
    felt: Felt, weights: Weights, leak: float, period: float,
) -> Sampled:  # fmt: skip
    plant = Plant("", steering, motor, sensors, rack_share, observer_bandwidth_Hz=1.0)
    open_ports = ports(plant, felt, weights, leak)
    q = problem(open_ports, delay(plant, period) + weights.late)
    full, gamma = synthesise(q)
    reduced, values = truncated(full, ORDER, np.array([1.0, ANGLE_SIZE, TORQUE_SIZE]))
    step, output = bilinear(reduced, period)
    omega = np.geomspace(SLOWEST, np.pi / period, POINTS)
    sampled = sampled_response(open_ports, step, output, plant, period, omega)
    loop = closed(q, reduced)
    arm = sampled[:, RESULTS.index("arm"), DISTURBANCES.index("hand")]
    achieved = Achieved(
        gamma=gamma,
        gamma_full=peak(response(*closed(q, full), omega)),
        gamma_reduced=peak(response(*loop, omega)) if np.linalg.eigvals(loop[0]).real.max() < 0.0 else np.inf,
        gamma_sampled=peak(sampled) if growth(open_ports, step, output, plant, period) < 1.0 else np.inf,
        arm=float(np.abs(arm).max()),
        order_full=float(len(full.A)),
        order=float(len(reduced.A)),
        truncation=2.0 * float(values[len(reduced.A) :].sum()),
    )
    return Sampled(*_padded(step, output), achieved)


def _padded(step: Matrix, output: Matrix) -> tuple[Matrix, Matrix]:
    """The same with ORDER states, those beyond its own being zero; read-only, as they are shared."""
    n = len(step)
    wide, long = np.zeros((ORDER, ORDER + 3)), np.zeros(ORDER + 3)
    wide[:n, :n], wide[:n, ORDER:] = step[:, :n], step[:, n:]
    long[:n], long[ORDER:] = output[:n], output[n:]
    return wide, long


def periods_late(plant: Plant, period: float) -> int:
    """Whole periods between a sensor's sample and the command that answers it."""
    return round(delay(plant, period) / period - 0.5)


def sampled_response(
    p: Ports, step: Matrix, output: Matrix, plant: Plant, period: float, omega: NDArray[np.float64]
) -> Complexes:
    """Disturbances to results [f, 4, 4] with the sampled law, the whole delay and the hold, omega [f] in rad/s."""
    n = len(step)
    s, z = 1j * omega[:, None, None], np.exp(1j * omega * period)[:, None, None]
    P = p.C @ np.linalg.solve(s * np.eye(len(p.A)) - p.A, np.broadcast_to(p.B, (omega.size, *p.B.shape))) + p.D
    own = step[:, :n] + np.outer(step[:, n], output[:n])
    enter = step[:, n + 1 :] + np.outer(step[:, n], output[n + 1 :])
    law = output[:n] @ np.linalg.solve(z * np.eye(n) - own, np.broadcast_to(enter, (omega.size, *enter.shape)))
    half = 0.5 * omega * period
    back = np.zeros((omega.size, 2, 3), dtype=complex)  # (e, v_ff, ordered) to (v, arrived)
    back[:, 0, :2] = law + output[n + 1 :]
    back[:, 1, 2] = np.exp(-1j * omega * period * periods_late(plant, period) - 1j * half) * np.sinc(half / np.pi)
    inner = np.linalg.solve(np.eye(2) - back @ P[:, 4:, 4:], back @ P[:, 4:, :4])
    return np.asarray(P[:, :4, :4] + P[:, :4, 4:] @ inner, dtype=complex)


def growth(p: Ports, step: Matrix, output: Matrix, plant: Plant, period: float) -> float:
    """Largest size of an eigenvalue of the sampled loop: stable below 1."""
    n, m, late = len(p.A), len(step), periods_late(plant, period)
    held = expm(period * np.block([[p.A, p.B[:, 5:]], [np.zeros((1, n + 1))]]))
    # States: ports, the law's, torques under way (newest first).
    size = n + m + late
    v = np.zeros(size)
    v[:n], v[n : n + m] = output[m + 1 :] @ p.C[4:6], output[:m]
    ordered = v.copy()
    ordered[:n] += p.C[6]
    A = np.zeros((size, size))
    A[:n, :n] = held[:n, :n]
    A[:n] += np.outer(held[:n, n], ordered if late == 0 else np.eye(size)[-1])
    A[n : n + m, n : n + m] = step[:, :m]
    A[n : n + m, :n] = step[:, m + 1 :] @ p.C[4:6]
    A[n : n + m] += np.outer(step[:, m], v)
    if late:
        A[n + m] = ordered
        A[n + m + 1 :, n + m : -1] = np.eye(late - 1)
    return float(np.abs(np.linalg.eigvals(A)).max())
