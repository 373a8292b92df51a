"""Parameters of the pid controller, by formulas from the plant's nominal numbers.

One number rules the design: the delay T_d between a motion and the torque that answers it (sensor
latency, one period to compute, dead time, half a period of hold, current loop). Every bandwidth is
a constant divided by T_d.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from controllers.blocks import Notch
from controllers.hardware import bar_notch, hardware_of, total_delay
from controllers.schedule import Schedule
from steer_env.plants import Plant, Reference
from steer_env.units import Quantity

_N = "the plant's nominal value"
# Constants over T_d; found by eigenvalues over arms, speeds and plants
# (experiments.coupled_stability).
ACCELERATION = 1.0  # bandwidth of the acceleration that enters the reference torque
DERIVATIVE = 1.5  # bandwidth of the torsion-bar torque's derivative
ANGLE = 0.075  # natural frequency of the angle loop: slow, because feed-forward does the work
TORQUE_INTEGRAL = 0.01  # corner of the torque integral
ANGLE_DAMPING = 0.9  # damping ratio of the angle loop
HAND_LAG = 1.2  # lag of the compensated hand torque where the torque sensor is stiff, in T_d
INTEGRAL_SHARE = 0.1  # corner of the angle integral as a share of the natural frequency


class PidParameters(NamedTuple):
    """Parameters of both laws; torques at the lower body unless said otherwise."""

    schedule: Schedule  # schedule_of(reference), float64 [n, 1 + fields of Felt]
    period: Annotated[float, Quantity("s", "control period", 1e-5, 0.05, "the loop's own")]
    delay: Annotated[float, Quantity("s", "T_d", 1e-5, 0.2, "computed from the plant")]
    motor_ratio: Annotated[float, Quantity("-", "motor ratio", 0.1, 100.0, _N)]
    rack_share: Annotated[float, Quantity("-", "1 where the car loads the lower body, 0 for SbW", 0.0, 1.0, _N)]
    J_pin: Annotated[float, Quantity("kg m2", "lower-body inertia", 5e-4, 1.0, _N)]
    b_pin: Annotated[float, Quantity("N m s/rad", "lower-body damping", 0.0, 20.0, _N)]
    M_fric: Annotated[float, Quantity("N m", "lower-body friction that is compensated", 0.0, 20.0, _N)]
    c_fric: Annotated[float, Quantity("N m/rad", "its Dahl stiffness", 0.1, 1e5, _N)]
    prediction: Annotated[float, Quantity("s", "stiffness foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    damping_prediction: Annotated[float, Quantity("s", "damping foretold by, impedance", 0.0, 0.1, "assumption: T_d")]
    command_age: Annotated[float, Quantity("periods", "command that moved the angle now seen", 1, 4, _N)]
    motor_decay: Annotated[float, Quantity("-", "what the motor's lag keeps over a period", 0.0, 1.0, _N)]
    c_tb: Annotated[float, Quantity("N m/rad", "torsion-bar stiffness", 10.0, 5e4, _N)]
    acceleration_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1 / T_d")]
    derivative_bandwidth: Annotated[float, Quantity("rad/s", "filter", 1.0, 1e4, "assumption: 1.5 / T_d, or 1 / lag")]
    damping_ratio: Annotated[
        float, Quantity("-", "least damping of stuck and torsion-bar modes", 0.0, 2.0, "assumption")
    ]
    bar_damping: Annotated[float, Quantity("-", "share of active torsion-bar damping", 0.0, 2.0, "0: notched instead")]
    torque_lag: Annotated[
        float,
        Quantity("s", "lag of the hand's torque", 0.0, 0.1, "assumption: 1.2 T_d where notched"),
    ]
    inertia_share: Annotated[
        float,
        Quantity("-", "share of J_pin that may be cancelled outright", 0.0, 1.0, "assumption"),
    ]
    slope_limit: Annotated[
        float,
        Quantity("-", "dM_eff/dM_tb beyond which the angle loop yields", 1.0, 50.0, "assumption"),
    ]
    torque_gain: Annotated[float, Quantity("-", "share of the matched torque gain", 0.0, 3.0, "assumption: 1")]
    torque_integral: Annotated[float, Quantity("1/s", "torque integral", 0.0, 1e3, "assumption: 0.01 / T_d")]
    angle_gain: Annotated[
        float,
        Quantity("1/s2", "angle P gain over inertia", 0.0, 1e5, "assumption: (0.075 / T_d)^2"),
    ]
    angle_integral: Annotated[float, Quantity("1/s3", "angle I gain over inertia", 0.0, 1e7, "assumption")]
    angle_derivative: Annotated[float, Quantity("1/s", "angle D gain over inertia", 0.0, 1e4, "assumption")]
    notch: Notch = Notch()


def design(plant: Plant, reference: Reference, period: float) -> PidParameters:
    """Parameters for a plant and a reference at a control period in s."""
    s = plant.steering
    delay = total_delay(plant, period)
    bar = bar_notch(plant, period)
    stiff = bar != Notch()
    natural = ANGLE / delay
    return PidParameters(
        **hardware_of(plant, reference, period),
        delay=delay,
        c_tb=s.c_tb,
        acceleration_bandwidth=ACCELERATION / delay,
        # A derivative of 1 / lag times the lag makes a plain first-order lag of the hand's torque.
        derivative_bandwidth=(1.0 / HAND_LAG if stiff else DERIVATIVE) / delay,
        damping_ratio=0.0 if stiff else 0.2,
        torque_lag=HAND_LAG * delay if stiff else 0.0,
        bar_damping=0.0 if stiff else 1.0,
        inertia_share=0.3,
        torque_gain=1.0,
        torque_integral=TORQUE_INTEGRAL / delay,
        angle_gain=natural * natural,
        angle_integral=INTEGRAL_SHARE * natural * natural * natural,
        angle_derivative=2.0 * ANGLE_DAMPING * natural,
        notch=bar,
    )
