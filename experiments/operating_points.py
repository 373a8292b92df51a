"""Where a loop is linearised: on centre or at the steepest assist, friction stuck or sliding.

The loop's non-linear parts are friction and assist (limits and end stops are out of reach), so four
points hold every slope that a small motion can meet:

    centre_stuck    rest in the middle; every friction is a spring (c_fric), hardest behind a delay
    centre_sliding  free return: no torsion-bar torque, friction slides and is carried by the load
    peak_stuck      a steady steer held where dM_eff / dM_tb is largest; small movements to and fro
                    have let every friction settle at zero torque, where it is a spring again
    peak_sliding    the same torque while the wheel turns on slowly

The steepest slope is looked for among the torques that the wheel can be held at inside its end stops
(at 15 km/h the published assist has no finite peak). A point is found by algebra, not by a run: where
the loop is unstable, no run would arrive. Torque and friction give M_eff, M_eff less friction gives
the load, the load's steady stiffness the angle, and from these follow the car, the frictions, the
motor's and the hand's torque, the observer and the generator; the program's own period then leaves a
stuck point where it is. Everything tracks perfectly there: the law sees the reference that belongs
to the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.rollout import first_observation
from steer_env.envs import batch
from steer_env.envs.layout import LINE_LENGTH, LINES, PARAMETERS, PERIOD, STATE, Clock
from steer_env.envs.task import Setup, Task, prepare
from steer_env.errors import InputError
from steer_env.interface import Observation
from steer_env.manoeuvres import MANOEUVRES, hand_at, kind_of
from steer_env.physics.assist import incremental_assist
from steer_env.physics.control_unit import Commands
from steer_env.physics.driver import Driver
from steer_env.physics.linear import load_matrices
from steer_env.physics.plant import PlantState
from steer_env.physics.reference import ReferenceParameters, effective_torque
from steer_env.physics.sensors import ObserverState
from steer_env.physics.steering import Steering
from steer_env.plants import Plant, Reference

Array = NDArray[np.float64]

POINTS = ("centre_stuck", "centre_sliding", "peak_stuck", "peak_sliding")
CLOCK = 2 * LINE_LENGTH  # the period that is looked at; any will do
SLIDING_RATE = 0.5  # rad/s; friction does not depend on it
HELD_SHARE = 0.95  # of the way to the end stop within which a steady steer is looked for
TORQUES = np.arange(0.0, 10.0, 0.01)  # N m at the torsion bar among which the steepest slope is
UNLIMITED = 1e9  # a limit that a small motion does not meet
HOLD = "random_torque"  # its tones stand still at this frequency: a constant torque of the hand
STANDING_Hz = 1e-12


class Place(NamedTuple):
    """One environment at one operating point, its wheel held by a torque and no arm.

    ``parameters`` [p], ``state`` [s], ``lines`` [4, 16] are the program's rows before a period;
    ``table`` and ``car_table`` its references over speed. ``observation`` is what the law saw last
    and ``slope`` dM_eff/dM_tb; ``hold`` in N m is the hand's torque.
    """

    point: str
    parameters: Array
    state: Array
    lines: Array
    table: Array
    car_table: Array
    observation: Observation
    slope: float
    hold: float

    @property
    def stuck(self) -> bool:
        """Whether friction sticks here."""
        return self.point.endswith("stuck")

    @property
    def admittance(self) -> bool:
        """Whether the reference is an angle."""
        return bool(PARAMETERS.read(self.parameters, "episode").admittance > 0.5)

    @property
    def reference(self) -> ReferenceParameters:
        """The reference at the place's speed."""
        p: ReferenceParameters = STATE.read(self.state, "reference")
        return p

    @property
    def steering(self) -> Steering:
        """The hardware's mechanics."""
        s: Steering = PARAMETERS.read(self.parameters, "steering")
        return s


def place_of(
    plant: Plant, causality: str, reference: Reference, speed_kmh: float, point: str, hardware: Plant | None = None
) -> Place:
    """The operating point of a plant at a speed; InputError where the point is not known.

    ``hardware`` is what is really there where it differs from the plant that controller and control
    unit were told.
    """
    if point not in POINTS:
        raise InputError("point", f"{point!r} is not known", f"use one of {', '.join(POINTS)}")
    task = Task(hardware or plant, causality, reference, manoeuvre="standstill", speed_kmh=speed_kmh)
    setup = prepare(task, np.random.default_rng(0), PERIOD)
    rows, states, lines = batch.new_rows(1)
    rows[0] = setup.row
    batch.start_batch(rows, states, lines, setup.table, setup.car_table)
    p: ReferenceParameters = STATE.read(states[0], "reference")
    M_tb = steepest_torque(first_observation(setup).speed, p, setup.plant) if point.startswith("peak") else 0.0
    rate = SLIDING_RATE if point.endswith("sliding") else 0.0
    hold, observation = _settle(setup, states[0], lines[0], M_tb, rate)
    _unlimited(rows[0], plant)
    return Place(
        point, rows[0], states[0], lines[0], setup.table, setup.car_table, observation, slope_at(M_tb, p), hold
    )


def slope_at(M_tb: float, p: ReferenceParameters) -> float:
    """dM_eff / dM_tb at a torsion-bar torque in N m."""
    return 1.0 + p.k_gain if p.linear > 0.5 else incremental_assist(M_tb, p.r, p.sigma)


def steepest_torque(speed: float, p: ReferenceParameters, plant: Plant) -> float:
    """Torsion-bar torque in N m with the steepest assist among those that can be held at a speed in m/s."""
    if p.linear > 0.5:
        return 0.0
    most = steady_load(speed, p)[0] * HELD_SHARE * plant.steering.angle_limit
    held = [M for M in TORQUES.tolist() if effective_torque(M, p) <= most]
    return max(held, key=lambda M: slope_at(M, p))


def steady_load(speed: float, p: ReferenceParameters) -> tuple[float, Array]:
    """(Load in N m, car's states [4]) per rad of pinion angle in a steady steer at a speed in m/s."""
    A, B, C, D = load_matrices(speed, p)
    states: Array = -np.linalg.solve(A, B[:, 0]).astype(np.float64)
    return float(C[0] @ states + D[0, 0]), states


def with_arms(place: Place, arms: Sequence[Driver]) -> Array:
    """Parameter rows [m, p] in which each of the arms holds the wheel where it is."""
    x: PlantState = STATE.read(place.state, "plant")
    rows = np.repeat(place.parameters[None, :], len(arms), axis=0)
    for row, arm in zip(rows, arms, strict=True):
        row[PARAMETERS["driver"]] = arm._replace(torque_limit=UNLIMITED)
        torque = place.hold + arm.k * x.steering_angle + arm.b * x.steering_rate
        row[PARAMETERS.column("manoeuvre", "amplitude")] = torque / held_torque(row)
    return rows


@cache
def _standing() -> Any:
    """A manoeuvre of amplitude 1 that stands still."""
    return MANOEUVRES[HOLD].parameters._replace(
        amplitude=1.0, frequency=STANDING_Hz, frequency_end=STANDING_Hz, lead_in=-1.0, duration=UNLIMITED
    )


def held_torque(row: Array) -> float:
    """The hand's torque in N m per unit of amplitude."""
    torque: float = hand_at(row[PARAMETERS.column("episode", "kind")], CLOCK * PERIOD, _standing()).torque
    return torque


def _settle(setup: Setup, state: Array, lines: Array, M_tb: float, rate: float) -> tuple[float, Observation]:
    """Write the point into the rows; (hand's torque in N m, what the law saw last)."""
    speed = first_observation(setup).speed
    s, rack = setup.plant.steering, setup.plant.rack_share
    p: ReferenceParameters = STATE.read(state, "reference")
    car: ReferenceParameters = STATE.read(state, "car")
    slides = 1.0 if rate > 0.0 else 0.0
    friction = slides * p.M_fric_C * (1.0 - p.linear)
    M_eff = effective_torque(M_tb, p)
    stiffness, felt_car = steady_load(speed, p)
    angle = (M_eff - friction - p.b_ref * rate) / stiffness
    car_stiffness, real_car = steady_load(speed, car)
    M_load = rack * car_stiffness * angle
    motor = (M_load + slides * s.M_fric + s.b_pin * rate - M_tb) / s.motor_ratio
    wheel = angle + M_tb / s.c_tb
    frictions = slides * s.M_s_fric, slides * s.M_fric
    state[STATE["plant"]] = [wheel, rate, angle, rate, *(real_car * angle), *frictions, motor, 0.0, 0.0]
    sensors = setup.plant.sensors
    seen = angle - rate * PERIOD * sensors.angle_delay
    observer = PARAMETERS.read(setup.row, "observer")
    unknown = observer.known_inputs * (M_tb + observer.motor_ratio * motor - observer.b * rate)
    state[STATE["observer"]] = ObserverState(seen, rate, unknown)
    admittance = PARAMETERS.read(setup.row, "episode").admittance > 0.5
    state[STATE["generator"]] = [angle if admittance else seen, rate, *(felt_car * angle), friction, M_eff]
    state[STATE["commands"]] = Commands(motor, motor, motor, motor)
    target = angle if admittance else M_tb
    state[STATE["clock"]] = Clock(float(CLOCK), speed, target)
    ages = np.arange(LINE_LENGTH)
    past = (CLOCK - 1 - ages) % LINE_LENGTH
    lines[LINES.index("command"), past] = motor
    lines[LINES.index("angle"), past] = angle - rate * PERIOD * ages
    lines[LINES.index("torque"), past] = M_tb
    lines[LINES.index("motor_torque"), past] = motor
    target_rate = rate if admittance else 0.0
    observation = Observation(seen, rate, 0.0, M_tb, target, target_rate, 0.0, M_eff, speed, motor, motor, motor, motor)
    return M_tb + slides * s.M_s_fric + s.b_s * rate, observation


def _unlimited(row: Array, told: Plant) -> None:
    """Constant hand torque, sensors that do not round, no limits, the observer that the unit was given."""
    sensors, motor = PARAMETERS.read(row, "sensors"), PARAMETERS.read(row, "motor")
    row[PARAMETERS["sensors"]] = sensors._replace(angle_step=0.0, angle_noise=0.0, torque_step=0.0, torque_noise=0.0)
    row[PARAMETERS["motor"]] = motor._replace(rated_torque=UNLIMITED, slew_rate=UNLIMITED)
    row[PARAMETERS["driver"]] = Driver(0.0, 0.0, 0.0, UNLIMITED)
    row[PARAMETERS["observer"]] = told.observer()
    row[PARAMETERS["manoeuvre"]] = _standing()._replace(amplitude=0.0)
    row[PARAMETERS.column("episode", "kind")] = kind_of(HOLD)
