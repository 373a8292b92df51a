"""What an identification should find: linear parameters derived from the test car's own equations.

The car is richer than the model that is fitted, so each number is a projection, defined here:

C_f, C_r: axle force over axle slip, first harmonic of a 0.2 Hz sine of the pinion at the
    sweep's amplitude. Forces are what the single track needs for the same motion,
    (l_r m a_y + J_z r')/L and so on; slips are what it sees from the pinion (angle / i_s, before
    compliance, roll steer and Ackermann). Tyre curvature and load transfer make them fall by one to
    three per cent from small motion to the driven amplitude; both are given.
n_t: M_rack i_s over that front force, same sine.
sigma_f, sigma_r: distance by which M_rack and the rear force lag behind those slips, mean over 0.2
    to 3 Hz, small motion.
J_z: the car's own.
c_pin_on: |M_rack / pinion angle| of the same sine.
J_ref, b_ref: least squares of J s2 + b s to J_pin s2 + b_pin s minus what the control unit's
    damping and inertia compensation deliver (with filters, dead time and lag), over 0.2 to 5 Hz.
k_gain: least squares of delivered basic assist to torsion-bar torque over the driven sweep.
c_pin_off: r c_pin_on, with r the off-centre ratio of the smooth law that fits the stored table over
    the driven torque.
M_fric_C: level of the Dahl friction (with the hardware's c_fric) that fits hardware friction minus
    delivered friction compensation over the driven 0.2 Hz sine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from steer_env.physics.boost_map import boost_torque, smooth_boost
from steer_env.physics.friction import dahl_step
from steer_env.physics.two_track_parameters import TwoTrack
from steer_env.testcar.harmonics import car_harmonics, harmonic
from steer_env.testcar.kernel import (
    PERIOD,
    RECORD,
    Machine,
    machine_at,
    rollout,
    unit_rollout,
)
from steer_env.testcar.parameters import VirtualCar
from steer_env.testcar.plan import robot_target
from steer_env.units import from_kmh

SMALL = 1e-3  # rad of pinion amplitude that counts as small motion
BASE_HZ = 0.2
BAND_HZ = np.linspace(0.2, 5.0, 25)
LAG_HZ = np.linspace(0.2, 3.0, 8)

Array = NDArray[np.floating]


def vehicle_truth(speed: float, amplitude: float, p: TwoTrack) -> dict[str, float]:
    """Single-track equivalents at a speed in m/s and a pinion amplitude in rad."""
    h = car_harmonics(speed, amplitude, BASE_HZ, p)
    lag_f, lag_r = [], []
    for frequency in LAG_HZ:
        s = car_harmonics(speed, SMALL, float(frequency), p)
        lag_f.append(_lag(s.rack_torque, s.front_slip, frequency) * speed)
        lag_r.append(_lag(s.rear_force, s.rear_slip, frequency) * speed)
    return {
        "n_t_m": abs(h.rack_torque) * p.i_s / abs(h.front_force),
        "sigma_f_m": float(np.mean(lag_f)),
        "sigma_r_m": float(np.mean(lag_r)),
        "C_f_N_per_rad": _ratio(h.front_force, h.front_slip),
        "C_r_N_per_rad": _ratio(h.rear_force, h.rear_slip),
        "J_z_kgm2": p.J_z,
        "c_pin_on_Nm_per_rad": abs(h.rack_torque / h.pinion_angle),
    }


def _ratio(force: complex, slip: complex) -> float:
    """Stiffness of a first-order lag from force and slip: C with F (1 + s sigma/v) = C a."""
    return 1.0 / float(np.real(slip / force))


def _lag(force: complex, slip: complex, frequency_Hz: float) -> float:
    """Time constant sigma/v in s of a first-order lag from slip to force."""
    inverse = slip / force
    return float(np.imag(inverse) / np.real(inverse) / (2.0 * np.pi * frequency_Hz))


def reference_truth(machine: Machine) -> tuple[float, float]:
    """Return (J_ref in kg m2, b_ref in N m s/rad); friction compensation is switched off for it."""
    quiet = machine._replace(law=machine.law._replace(friction_compensation=0.0))
    steering = machine.mechanics.steering
    J = b = weight_J = weight_b = 0.0
    for frequency in BAND_HZ:
        omega = 2.0 * np.pi * frequency
        window = round(max(2, round(2.0 * frequency)) / frequency / PERIOD)
        t = np.arange(window + 1000) * PERIOD
        angle = np.sin(omega * t)
        delivered = unit_rollout(np.zeros_like(t), angle, quiet)[-window:, 1]
        time = t[-window:]
        unit = harmonic(delivered, time, frequency) / harmonic(angle[-window:], time, frequency)
        Z = -steering.J_pin * omega * omega + 1j * omega * steering.b_pin - unit
        J -= np.real(Z) * omega * omega
        b += np.imag(Z) * omega
        weight_J += omega**4
        weight_b += omega**2
    return float(J / weight_J), float(b / weight_b)


def off_centre_ratio(machine: Machine, largest_torque: float, width: float) -> float:
    """Ratio r of the smooth law nearest to the table, up to ``largest_torque`` in N m."""
    torque = np.linspace(0.02, largest_torque, 200)
    table = np.array([boost_torque(M, machine.law.knots) for M in torque])

    def error(r: float) -> float:
        return sum(
            (smooth_boost(M, r, width) - held) ** 2 for M, held in zip(torque, table, strict=True)
        )

    return float(
        minimize_scalar(error, bounds=(0.005, 0.95), method="bounded", options={"xatol": 1e-7}).x
    )


def friction_truth(record: Array, machine: Machine) -> float:
    """M_fric_C in N m over a driven 0.2 Hz sine: see the definition above."""
    law = machine.law._replace(active_damping=0.0, inertia_compensation=0.0)
    angle = record[:, RECORD.index("pinion_angle")]
    delivered = unit_rollout(np.zeros(len(record)), angle, machine._replace(law=law))[:, 1]
    thin = slice(None, None, 10)  # Dahl is exact over any one-way step
    net = (record[:, RECORD.index("pinion_friction")] - delivered)[thin]
    steps = np.diff(angle[thin])
    half = len(net) // 2
    c_fric = machine.mechanics.steering.c_fric

    def error(level: float) -> float:
        torque, shape = 0.0, np.zeros(len(net))
        for k, step in enumerate(steps):
            torque = dahl_step(torque, step, level, c_fric)
            shape[k + 1] = torque
        return float(np.mean((shape[half:] - net[half:]) ** 2))

    return float(
        minimize_scalar(error, bounds=(0.05, 8.0), method="bounded", options={"xatol": 1e-4}).x
    )


def truth_at(speed_kmh: float, sine: float, sweep: float, car: VirtualCar) -> dict[str, object]:
    """True row of one speed; ``sine`` and ``sweep`` are driven wheel-angle amplitudes in rad."""
    speed = from_kmh(speed_kmh)
    machine = machine_at(speed, car)
    swept, steady = (
        _driven("frequency_response", sweep, speed, machine),
        _driven("steady_state", sine, speed, machine),
    )
    M_tb, basic = (
        swept[:, RECORD.index("torsion_bar_torque")],
        swept[:, RECORD.index("basic_assist")],
    )
    pinion = steady[:, RECORD.index("pinion_angle")]
    share = sweep / sine
    small, row = (
        vehicle_truth(speed, SMALL, car.vehicle),
        vehicle_truth(speed, share * pinion.max(), car.vehicle),
    )
    J_ref, b_ref = reference_truth(machine)
    largest = float(np.abs(steady[:, RECORD.index("torsion_bar_torque")]).max())
    width = car.calibration.on_centre_width
    ratio = off_centre_ratio(machine, largest, width)
    return {
        "speed_kmh": speed_kmh,
        "J_ref_kgm2": J_ref,
        "b_ref_Nms_per_rad": b_ref,
        "k_gain": float(np.sum(basic * M_tb) / np.sum(M_tb * M_tb)),
        **row,
        "c_pin_off_Nm_per_rad": ratio * row["c_pin_on_Nm_per_rad"],
        "M_fric_C_Nm": friction_truth(steady, machine),
        "sigma_assist_Nm": width,
        "c_fric_Nm_per_rad": car.steering.c_fric,
        "small_motion": small,
        "lateral_acceleration_mps2": float(steady[:, RECORD.index("lateral_acceleration")].max()),
        "largest_torsion_bar_torque_Nm": largest,
        "sine_amplitude_rad": sine,
        "sweep_amplitude_rad": sweep,
    }


def _driven(manoeuvre: str, amplitude: float, speed: float, machine: Machine) -> Array:
    """Noise-free record of a manoeuvre."""
    angle, rate = robot_target(manoeuvre, amplitude)
    quiet = np.zeros_like(angle)
    return rollout(angle, rate, quiet, quiet, speed, machine)
