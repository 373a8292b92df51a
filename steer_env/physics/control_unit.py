"""The control unit: from what the sensors report to what a controller sees, once per period."""

from __future__ import annotations

from typing import NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.reference import (
    ReferenceParameters,
    ReferenceState,
    TrackMap,
    admittance_step,
    impedance_step,
)
from steer_env.physics.sensors import Observer, ObserverState, observer_step


class Observation(NamedTuple):
    """What a controller sees, SI. Everything comes from measurements; nothing hidden is in it.

    ``reference`` is a torsion-bar torque in N m (impedance) or a pinion angle in rad (admittance);
    ``reference_rate`` is its derivative; ``reference_acceleration`` in rad/s2 is the admittance
    generator's (0 in impedance); ``effective_torque`` in N m is M_eff of Fig. 2. ``last_torque_1``
    is the newest of the last commands in N m.
    """

    pinion_angle: float
    pinion_rate: float
    pinion_acceleration: float
    torsion_bar_torque: float
    reference: float
    reference_rate: float
    reference_acceleration: float
    effective_torque: float
    speed: float
    last_torque_1: float
    last_torque_2: float
    last_torque_3: float
    last_torque_4: float


class Commands(NamedTuple):
    """The last four motor commands in N m, newest first."""

    last_1: float
    last_2: float
    last_3: float
    last_4: float


@scalar
def control_unit_step(
    angle: float,
    M_tb: float,
    motor_estimate: float,
    commands: Commands,
    speed: float,
    admittance: float,
    observer_state: ObserverState,
    generator: ReferenceState,
    last_reference: float,
    observer: Observer,
    reference: ReferenceParameters,
    track: TrackMap,
    dt: float,
) -> tuple[Observation, ObserverState, ReferenceState]:
    """One period: measured angle (rad) and torque (N m) in; observation and new states out.

    ``motor_estimate`` is the unit's own model of its motor's torque in N m; ``admittance`` is 1 for
    the admittance generator and 0 for the impedance generator; ``last_reference`` is the reference
    of the period before; ``track`` is the reference's car over a period (``track_map``), for the impedance generator.
    """
    acceleration, seen = observer_step(observer_state, angle, M_tb, motor_estimate, observer, dt)
    if admittance > 0.5:
        reference_acceleration, new = admittance_step(M_tb, generator, speed, reference, dt)
        target, rate, M_eff = new.pinion_angle, new.pinion_rate, new.effective_torque
    else:
        target, M_eff, new = impedance_step(seen.angle, seen.rate, acceleration, generator, speed, reference, track)
        rate = (target - last_reference) / dt
        reference_acceleration = 0.0
    observation = Observation(
        seen.angle,
        seen.rate,
        acceleration,
        M_tb,
        target,
        rate,
        reference_acceleration,
        M_eff,
        speed,
        commands.last_1,
        commands.last_2,
        commands.last_3,
        commands.last_4,
    )
    return observation, seen, new
