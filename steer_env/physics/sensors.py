"""Sensors: noise, resolution, and the observer that finds rate and acceleration."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from steer_env.physics._jit import scalar
from steer_env.physics.elementary import exponential
from steer_env.units import Quantity


class Sensors(NamedTuple):
    """What the control unit measures with; delays count periods. Defaults: the paper's rig."""

    angle_step: Annotated[float, Quantity("rad", "angle resolution", 0.0, 0.1, "paper, section 2: 0.009 deg")] = (
        1.5708e-4
    )
    angle_noise: Annotated[float, Quantity("rad", "angle noise, rms", 0.0, 0.1, "assumption")] = 0.0
    angle_delay: Annotated[float, Quantity("periods", "angle latency", 0, 15, "assumption: one CAN cycle")] = 1.0
    torque_step: Annotated[float, Quantity("N m", "torque resolution", 0.0, 1.0, "paper, section 2: 0.03 N m")] = 0.03
    torque_noise: Annotated[float, Quantity("N m", "torque noise, rms", 0.0, 1.0, "assumption")] = 0.01
    torque_delay: Annotated[float, Quantity("periods", "torque latency", 0, 15, "assumption: one CAN cycle")] = 1.0
    torque_gain: Annotated[float, Quantity("-", "reading over torque", 0.2, 5.0, "assumption: exact")] = 1.0
    torque_offset: Annotated[float, Quantity("N m", "reading minus torque", -5.0, 5.0, "assumption: exact")] = 0.0


class Observer(NamedTuple):
    """What the control unit believes of its own hardware, and how fast its observer is."""

    J: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, "the plant's nominal value")] = 0.065
    b: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, "the plant's nominal value")] = 0.4
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, "the plant's nominal value")] = 21.0
    bandwidth_Hz: Annotated[float, Quantity("Hz", "observer bandwidth", 1.0, 300.0, "assumption")] = 40.0
    known_inputs: Annotated[
        float, Quantity("-", "1: driven by measured and motor torque, 0: by the angle alone", 0, 1, "assumption: 1")
    ] = 1.0


class ObserverState(NamedTuple):
    """Estimated angle (rad), rate (rad/s), and unknown load torque on the lower body (N m)."""

    angle: float
    rate: float
    load: float


@scalar
def measured(value: float, step: float, noise_rms: float, noise: float) -> float:
    """A value as a sensor reports it: noise (a standard normal draw), then the resolution."""
    noisy = value + noise_rms * noise
    if step <= 0.0:
        return noisy
    return math.copysign(step * math.floor(abs(noisy) / step + 0.5), noisy)


@scalar
def observer_step(
    x: ObserverState, angle: float, M_tb: float, motor_torque: float, p: Observer, dt: float
) -> tuple[float, ObserverState]:
    """(acceleration in rad/s2, new state) of the lower body after dt seconds.

    Measured torsion-bar torque and the known motor torque drive a model of the body, so that the
    acceleration needs no differentiation; the angle only corrects it and finds the unknown load.
    Gains of the critically damped third-order tracking filter (triple pole z = exp(-2 pi f dt)). At
    40 Hz, 1 kHz and the default body, white noise of 1 rad rms in the angle gives 12500 rad/s2 rms,
    of 1 N m in the torque 15.6 rad/s2.

    Without known inputs the same filter tracks the angle alone, and the acceleration is the filtered
    second difference (1 - z)^3 / dt^2 q (q - 1)^2 / (q - z)^3 of it, late by 3 / (2 pi f) at low
    frequency. White noise of 1 rad rms then gives sqrt(6) ((1 - z) / (1 + z))^2.5 / dt^2.
    """
    z = exponential(-2.0 * math.pi * p.bandwidth_Hz * dt)
    known = M_tb + p.motor_ratio * motor_torque
    a = (p.known_inputs * (known - p.b * x.rate) - x.load) / p.J
    predicted = x.angle + dt * x.rate + 0.5 * dt * dt * a
    error = angle - predicted
    new = ObserverState(
        predicted + (1.0 - z * z * z) * error,
        x.rate + dt * a + 1.5 * (1.0 - z) * (1.0 - z) * (1.0 + z) / dt * error,
        x.load - p.J * (1.0 - z) * (1.0 - z) * (1.0 - z) / (dt * dt) * error,
    )
    return (p.known_inputs * (known - p.b * new.rate) - new.load) / p.J, new
