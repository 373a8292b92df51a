"""How many Runge-Kutta steps a control period needs: error, stability limit and cost.

    python -m experiments.integrator_study

Each plant is driven as the environments drive it (hand and motor held for a period of 1 ms) by the
steering robot: a chirp at its rate limit, and slow reversals where friction matters. "Truth" is the
same integrator with 128 steps a period. ``frozen`` holds the friction torques over each step.
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from steer_env.envs.layout import PERIOD
from steer_env.physics._jit import compiled
from steer_env.physics.driver import Driver, Hand
from steer_env.physics.friction import dahl_step
from steer_env.physics.linear import jacobian
from steer_env.physics.motor import lag_decay
from steer_env.physics.plant import PlantState, plant_step
from steer_env.physics.reference import ReferenceParameters
from steer_env.physics.steering import Steering
from steer_env.plants import DRIVERS, PLANTS, Reference
from steer_env.units import from_kmh, to_deg

SUBSTEPS = (1, 2, 4, 8)
TRUTH = 128
PERIODS = 3000
Array = NDArray[np.float64]


class Case(NamedTuple):
    """A plant with the driver and the car around it."""

    name: str
    steering: Steering
    bandwidth_Hz: float
    rated_torque: float
    rack_share: float
    driver: Driver
    car: ReferenceParameters
    speed: float


def cases() -> list[Case]:
    """Both plants as they are, at the stiff end of their spread, and stiffer torque flanges."""
    speed = from_kmh(105.0)  # the shortest relaxation time of the published rows
    car = Reference().at(speed)
    found = []
    for name, plant in PLANTS.items():
        variants = {"nominal": plant.steering, "stiff": _stiff(name)}
        if name == "SbW":
            flanges = (6000.0, 15000.0)
            variants |= {f"c_tb {c:.0f}": plant.steering._replace(c_tb=c) for c in flanges}
        for label, steering in variants.items():
            factor = plant.spread["motor.bandwidth_Hz"][1] if label.startswith("stiff") else 1.0
            found.append(
                Case(
                    f"{name} {label}",
                    steering,
                    factor * plant.motor.bandwidth_Hz,
                    plant.motor.rated_torque,
                    plant.rack_share,
                    DRIVERS["robot"],
                    car,
                    speed,
                )
            )
    return found


def _stiff(name: str) -> Steering:
    """Light bodies, stiff springs, much friction: what the plant's own randomisation may draw."""
    plant = PLANTS[name]
    steering = plant.steering
    for field, (low, high) in plant.spread.items():
        part, key = field.split(".")
        if part == "steering":
            factor = low if key in ("J_s", "J_pin", "b_s", "b_tb", "b_pin") else high
            steering = steering._replace(**{key: getattr(steering, key) * factor})
    return steering


@compiled
def drive(
    hands: Array,
    targets: Array,
    substeps: int,
    frozen: bool,
    bandwidth_Hz: float,
    speed: float,
    rack_share: float,
    steering: Steering,
    without_memory: Steering,
    driver: Driver,
    car: ReferenceParameters,
    out: Array,
) -> None:
    """Fill out [n, 13] with states after each period; ``without_memory`` has no Dahl stiffness."""
    x = PlantState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    h = PERIOD / substeps
    decay = lag_decay(bandwidth_Hz, 0.5 * h)
    for k in range(len(targets)):
        hand = Hand(hands[k, 0], hands[k, 1], 0.0, 1.0)
        for _ in range(substeps):
            law = without_memory if frozen else steering
            y = plant_step(x, targets[k], decay, hand, speed, rack_share, law, driver, car, h)
            wheel = y.steering_angle - x.steering_angle
            pinion = y.pinion_angle - x.pinion_angle
            x = PlantState(
                y.steering_angle,
                y.steering_rate,
                y.pinion_angle,
                y.pinion_rate,
                y.lateral_speed,
                y.yaw_rate,
                y.slip_front,
                y.slip_rear,
                dahl_step(x.wheel_friction, wheel, steering.M_s_fric, steering.c_s_fric),
                dahl_step(x.pinion_friction, pinion, steering.M_fric, steering.c_fric),
                y.motor_torque,
                0.0,
                0.0,
            )
        for j in range(len(x)):
            out[k, j] = x[j]


def run(case: Case, inputs: tuple[Array, Array], substeps: int, frozen: bool = False) -> Array:
    """States [n, 13] after each period."""
    hands, targets = inputs
    out = np.zeros((len(targets), len(PlantState._fields)))
    around = (case.bandwidth_Hz, case.speed, case.rack_share, case.steering)
    rigid = case.steering._replace(c_fric=0.0, c_s_fric=0.0)
    drive(hands, targets, substeps, frozen, *around, rigid, case.driver, case.car, out)
    return out


def chirp(case: Case) -> tuple[Array, Array]:
    """0.2 to 5 Hz in 3 s at the robot's 20 rad/s, and motor commands that jump every 20 ms."""
    t = PERIOD * (np.arange(PERIODS) + 0.5)
    phase = 2.0 * np.pi * (0.2 + 0.5 * 1.6 * t) * t
    rate = 2.0 * np.pi * (0.2 + 1.6 * t)
    size = np.minimum(20.0 / rate, 0.5)
    hands = np.column_stack([size * np.sin(phase), size * rate * np.cos(phase)])
    return hands, _jumps(case, 0.3)


def reversals(case: Case) -> tuple[Array, Array]:
    """Small swings of 2 deg at 2 Hz, inside and across the friction's hysteresis."""
    t = PERIOD * (np.arange(PERIODS) + 0.5)
    w = 4.0 * np.pi
    return np.column_stack([0.035 * np.sin(w * t), 0.035 * w * np.cos(w * t)]), _jumps(case, 0.02)


def _jumps(case: Case, share: float) -> Array:
    draws = np.random.default_rng(1).uniform(-1.0, 1.0, PERIODS // 20)
    return share * case.rated_torque * np.repeat(draws, 20)


def torque_error(case: Case, states: Array, truth: Array) -> tuple[float, float]:
    """(rms, largest) error of the torsion-bar torque in N m."""
    p = case.steering
    torque = [p.c_tb * (s[:, 0] - s[:, 2]) + p.b_tb * (s[:, 1] - s[:, 3]) for s in (states, truth)]
    error = np.nan_to_num(np.abs(torque[0] - torque[1]), nan=np.inf)
    return float(np.sqrt(np.mean(np.minimum(error, 1e9) ** 2))), float(error.max())


def stability_limit(case: Case) -> float:
    """Longest stable step in s, with friction stuck: spectral radius of the step's own Jacobian."""

    def grows(h: float) -> bool:
        decay = lag_decay(case.bandwidth_Hz, 0.5 * h)
        hand = Hand(0.0, 0.0, 0.0, 1.0)

        def step(z: Array) -> Any:
            x = PlantState(*z.tolist())
            around = (case.speed, case.rack_share, case.steering, case.driver, case.car)
            return plant_step(x, 0.0, decay, hand, *around, h)

        radius = np.abs(np.linalg.eigvals(jacobian(step, len(PlantState._fields), 1e-9))).max()
        return bool(radius > 1.0 + 1e-6)

    low, high = 1e-5, 2e-2
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return low


def cost(case: Case, substeps: int) -> float:
    """Microseconds of plant per period, the best of seven runs."""
    inputs, best = chirp(case), np.inf
    for _ in range(7):
        start = time.perf_counter()
        run(case, inputs, substeps)
        best = min(best, time.perf_counter() - start)
    return 1e6 * float(best) / PERIODS


def study() -> Table:
    """One row per plant, integrator and substeps."""
    table = Table(title="Plant integrator at a control period of 1 ms")
    columns = ("plant", "friction", "steps", "chirp: rms", "largest / N m", "reversals: rms")
    for name in (*columns, "largest / N m", "angle / mdeg", "limit / ms", "cost / us"):
        left = name in ("plant", "friction")
        table.add_column(name, justify="left" if left else "right", no_wrap=True)
    table.caption = (
        "errors of torsion-bar torque and pinion angle at the ends of periods; limit: longest "
        "stable step with stuck friction; the torque sensor resolves 0.03 N m, the encoder 9 mdeg"
    )
    for case in cases():
        limit = 1e3 * stability_limit(case)
        drives = [f(case) for f in (chirp, reversals)]
        truths = [run(case, inputs, TRUTH) for inputs in drives]
        for frozen in (False, True):
            for n in SUBSTEPS:
                states = [run(case, inputs, n, frozen) for inputs in drives]
                errors = [torque_error(case, s, t) for s, t in zip(states, truths, strict=True)]
                angle = max(np.abs(s - t)[:, 2].max() for s, t in zip(states, truths, strict=True))
                numbers = [f"{value:.2g}" for pair in errors for value in pair]
                numbers.append(f"{1e3 * to_deg(float(angle)):.2g}")
                numbers += ["", ""] if frozen else [f"{limit:.2f}", f"{cost(case, n):.2f}"]
                table.add_row(case.name, "frozen" if frozen else "exact", str(n), *numbers)
        table.add_section()
    return table


if __name__ == "__main__":
    Console(width=140).print(study())
