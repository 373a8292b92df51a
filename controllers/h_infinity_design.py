"""Parameters of the h_infinity controller: the plant's numbers, the weights and what comes of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from controllers.h_infinity_plant import Felt, Weights
from controllers.h_infinity_sampled import Achieved, designed
from controllers.hardware import hardware_of, total_delay
from controllers.law import Gain, with_gains
from controllers.schedule import Felt as Row
from controllers.synthesis import Matrix
from steer_env.physics.linear import load_matrices
from steer_env.physics.reference import ReferenceParameters
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
_A = "assumption, found by search over drawn plants"


class HInfinityParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Any  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    instant: Any  # float64 [n]: stiffness of the reference's load at once, N m/rad, for each row
    step: Any  # float64 [10, 13]: linear part one period on from its states, v, e, v_ff
    output: Any  # float64 [13]: v from the same (nothing from v)
    achieved: Achieved
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    least_inertia: Annotated[float, Quantity("kg m2", "least felt inertia that is followed", 1e-4, 1.0, _A)]
    fastest: Annotated[float, Quantity("rad/s2", "most acceleration followed, impedance", 1.0, 1e5, "5 Hz at 23 deg")]
    return_rate: Annotated[float, Quantity("rad/s", "return of what was not, admittance", 0.0, 100.0, _A)]
    leak: Annotated[float, Quantity("1/s", "own motion towards the measured one, impedance", 0.0, 100.0, _A)]
    own: Annotated[float, Quantity("-", "springs: 1 at the own, 0 at the measured motion, impedance", 0.0, 1.0, _A)]
    lead: Annotated[float, Quantity("s", "springs: foretelling of the motion, impedance", 0.0, 0.1, _A)]
    felt_inertia: Annotated[float, Quantity("kg m2", "J_ref over the assist's slope, of the design", 1e-4, 1.0, _A)]
    accuracy: Annotated[float, Quantity("-", "hand torque over the error's torque", 0.1, 1e4, _A)]
    natural: Annotated[float, Quantity("rad/s", "n of the error's weight", 0.1, 1e3, _A)]
    bandwidth: Annotated[float, Quantity("rad/s", "up to which accuracy is asked for", 1.0, 1e3, _A)]
    integral: Annotated[float, Quantity("1/s", "integral in the error's weight", 0.0, 100.0, _A)]
    gain_error: Annotated[float, Quantity("-", "error of the motor's path, slow", 1e-3, 0.99, _A)]
    gain_bandwidth: Annotated[float, Quantity("rad/s", "where that error is 1", 10.0, 5e3, _A)]
    inertia_error: Annotated[float, Quantity("-", "r of the lower body", 1e-3, 0.99, _A)]
    load: Annotated[float, Quantity("-", "torque at the lower body over the hand's", 1e-2, 100.0, _A)]
    angle_noise: Annotated[float, Quantity("rad", "noise of e", 1e-8, 0.1, _A)]
    torque_noise: Annotated[float, Quantity("N m", "noise of v_ff", 1e-5, 10.0, _A)]
    late: Annotated[float, Quantity("s", "delay counted with beyond the known one", 0.0, 0.1, _A)]
    heavy: Annotated[float, Quantity("-", "inertia of the lower body counted with, over J_pin", 0.5, 2.0, _A)]


def weights_for(plant: Plant, impedance: bool, delay: float) -> Weights:
    """The weights for a plant of which ``delay`` s is T_d: rates are constants over it.

    Found by search: with a rack over drawn plants, whose inertia goes up to 1.7 times and whose dead
    time to 3 periods; without one over the stability of drawn plants and the tracking of the nominal one.
    """
    if plant.rack_share < 0.5:
        return Weights(
            felt_inertia=0.0034, accuracy=34.0, natural=0.23 / delay, bandwidth=0.24 / delay, integral=11.5,
            gain_error=0.27, gain_bandwidth=3.0 / delay, inertia_error=0.12, load=0.25,
            angle_noise=7e-7, torque_noise=0.034, late=0.0, heavy=1.0,
        )  # fmt: skip
    if impedance:
        return Weights(
            felt_inertia=0.0061, accuracy=45.0, natural=0.093 / delay, bandwidth=0.2 / delay, integral=0.41,
            gain_error=0.31, gain_bandwidth=1.28 / delay, inertia_error=0.35, load=4.0,
            angle_noise=5.7e-6, torque_noise=0.0086, late=0.06 * delay, heavy=1.36,
        )  # fmt: skip
    return Weights(
        felt_inertia=0.0049, accuracy=56.0, natural=0.165 / delay, bandwidth=0.143 / delay, integral=1.03,
        gain_error=0.4, gain_bandwidth=2.35 / delay, inertia_error=0.124, load=4.6,
        angle_noise=3.7e-6, torque_noise=0.019, late=0.047 * delay, heavy=1.09,
    )  # fmt: skip


def felt_of(schedule: Matrix) -> Felt:
    """The reference that the design counts with: the median over the rows of ``schedule_of``."""
    rows = [Row(*row[1:].tolist()) for row in schedule]
    damping, stiffness = zip(*((r.b_ref / r.J_ref, r.stiffness / r.J_ref) for r in rows), strict=True)
    return Felt(float(np.median(damping)), float(np.median(stiffness)))


def instant_stiffness(reference: Reference) -> Matrix:
    """What a sudden turn changes of the reference's load, N m/rad, for each row of its table [n]."""
    rows = ((float(row[0]), ReferenceParameters(*row[1:].tolist())) for row in reference.table)
    return np.array([load_matrices(speed, p)[3][0, 0] for speed, p in rows])


def design(
    plant: Plant, reference: Reference, impedance: bool, period: float, gains: Mapping[str, Gain]
) -> HInfinityParameters:
    """Parameters for a plant and a reference at a control period in s; ``gains`` replace fields."""
    delay = total_delay(plant, period)
    asked = {name: gain for name, gain in gains.items() if name in Weights._fields}
    weights = with_gains(weights_for(plant, impedance, delay), asked, "h_infinity")
    hardware = hardware_of(plant, reference, period)
    rack = plant.rack_share > 0.5
    parameters = HInfinityParameters(
        **{name: hardware[name] for name in HInfinityParameters._fields if name in hardware},
        instant=instant_stiffness(reference),
        step=np.empty(0),
        output=np.empty(0),
        achieved=Achieved(*[np.nan] * len(Achieved._fields)),
        least_inertia=(0.0037 if rack else 0.003),
        fastest=400.0,
        return_rate=(0.028 if rack else 0.016) / delay,
        leak=(0.052 if rack else 0.04) / delay,
        own=0.72 if rack else 0.55,
        lead=(0.21 if rack else 0.6) * delay,
        **weights._asdict(),
    )
    others = {name: gain for name, gain in gains.items() if name not in asked}
    parameters = with_gains(parameters, others, "h_infinity")
    leak = parameters.leak if impedance else 0.0
    sampled = designed(plant, felt_of(parameters.schedule), weights, leak, period)
    return parameters._replace(**sampled._asdict())
