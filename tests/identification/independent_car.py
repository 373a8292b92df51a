"""Synthetic campaigns from a separate derivation: numpy only, not one line shared with the project.

Linear single track with tyre relaxation (Eq. 6), pinion balance (Eq. 4, linear or with Gaussian assist and Dahl
friction), torsion bar, steering wheel, and a robot that closes the loop on the steering angle. All runs are stepped
together as one batch (RK4, 1 ms) and logged at 100 Hz. ISO 8855 signs, SI units.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

STEP = 1e-3
LOG_EVERY = 10
SWEEP_LIMIT = 0.4  # rad at the wheel: 5 Hz then needs 12 rad/s, about what a steering robot can do


@dataclass(frozen=True)
class Car:
    """Truth of one speed; ordinary estate-car values, chosen here."""

    speed: float
    m: float = 1640.0
    l_f: float = 1.24
    l_r: float = 1.46
    i_s: float = 16.2
    i_rp: float = 118.0
    J_z: float = 2800.0
    C_f: float = 118e3
    C_r: float = 146e3
    sigma_f: float = 0.31
    sigma_r: float = 0.37
    n_t: float = 0.083
    J_ref: float = 0.060
    b_ref: float = 0.74
    k_gain: float = 2.4
    assist_ratio: float = 1.0  # r = c_off / c_on; used when nonlinear
    sigma_assist: float = 1.8
    M_C: float = 0.0
    c_fric: float = 200.0
    nonlinear: bool = False
    J_s: float = 0.040
    J_rob: float = 0.030
    b_s: float = 0.10
    c_tb: float = 115.0
    b_tb: float = 0.30
    robot_stiffness: float = 260.0
    robot_damping: float = 6.0


@dataclass(frozen=True)
class Noise:
    """Standard deviation of white measurement noise per channel, and latency per source (s)."""

    angle: float = np.deg2rad(0.02)
    torque: float = 0.03
    robot_torque: float = 0.05
    rack_force: float = 25.0
    yaw_rate: float = np.deg2rad(0.05)
    acceleration: float = 0.03
    lateral_speed: float = 0.01
    latency_imu: float = 0.0
    latency_rack: float = 0.0
    latency_bar_torque: float = 0.0
    latency_robot: float = 0.0


def chirp(t, amplitude, start=0.5, low=0.2, high=5.0, duration=17.5):
    """Linear sweep; zero before `start`, zero after its end."""
    x = np.clip(t - start, 0.0, duration)
    phase = 2 * np.pi * (low * x + 0.5 * (high - low) / duration * x * x)
    return amplitude * np.sin(phase) * ((t >= start) & (t <= start + duration))


def sine(t, amplitude, frequency=0.2):
    """0.2 Hz sine, eased in over one second so that no step excites the bar."""
    return amplitude * np.sin(2 * np.pi * frequency * t) * np.clip(t, 0.0, 1.0)


def gaussian_gain(M, r, sigma):
    return 1.0 / ((1.0 - r) * np.exp(-0.5 * (M / sigma) ** 2) + r)


def rates(x, reference, reference_rate, p):
    """Derivative of [steer, steer', pinion, pinion', v_y, yaw rate, a_f, a_r, friction], each a vector over runs."""
    steer, steer_rate, pin, pin_rate, vy, yaw, af, ar, friction = x
    M_tb = p["c_tb"] * (steer - pin) + p["b_tb"] * (steer_rate - pin_rate)
    M_s = p["robot_stiffness"] * (reference - steer) + p["robot_damping"] * (reference_rate - steer_rate)
    wheel = (M_s - M_tb - p["b_s"] * steer_rate) / (p["J_s"] + p["J_rob"])
    gain = np.where(p["nonlinear"], gaussian_gain(M_tb, p["assist_ratio"], p["sigma_assist"]), 1.0 + p["k_gain"])
    rack = p["C_f"] * p["n_t"] * af / p["i_s"]
    pinion = (gain * M_tb - p["b_ref"] * pin_rate - rack - friction) / p["J_ref"]
    v = p["speed"]
    side_f, side_r = p["C_f"] * af, p["C_r"] * ar
    friction_rate = np.where(
        p["M_C"] > 0, p["c_fric"] * (pin_rate - np.abs(pin_rate) * friction / np.maximum(p["M_C"], 1e-9)), 0.0
    )
    return np.array([
        steer_rate, wheel, pin_rate, pinion,
        (side_f + side_r) / p["m"] - v * yaw,
        (p["l_f"] * side_f - p["l_r"] * side_r) / p["J_z"],
        (v * (pin / p["i_s"] - af) - vy - p["l_f"] * yaw) / p["sigma_f"],
        (-v * ar - vy + p["l_r"] * yaw) / p["sigma_r"],
        friction_rate,
    ]), M_s, M_tb  # fmt: skip


def simulate(cars, references, duration):
    """Step all runs together; `references` maps time (scalar) to a vector over runs. Returns dict of [n, runs]."""
    p = {k: np.array([getattr(c, k) for c in cars]) for k in Car.__dataclass_fields__}
    steps = round(duration / STEP)
    half = np.arange(2 * steps + 1) * STEP / 2
    target = references(half)
    target_rate = np.gradient(target, STEP / 2, axis=0)
    x = np.zeros((9, len(cars)))
    log = {k: [] for k in ("steer", "pin", "M_s", "M_tb", "rack", "vy", "yaw", "ay")}
    for i in range(steps):
        k1, M_s, M_tb = rates(x, target[2 * i], target_rate[2 * i], p)
        if i % LOG_EVERY == 0:
            values = (x[0], x[2], M_s, M_tb, p["i_rp"] * p["C_f"] * p["n_t"] * x[6] / p["i_s"], x[4], x[5],
                      (p["C_f"] * x[6] + p["C_r"] * x[7]) / p["m"])  # fmt: skip
            for name, value in zip(log, values, strict=True):
                log[name].append(value.copy())
        k2 = rates(x + 0.5 * STEP * k1, target[2 * i + 1], target_rate[2 * i + 1], p)[0]
        k3 = rates(x + 0.5 * STEP * k2, target[2 * i + 1], target_rate[2 * i + 1], p)[0]
        k4 = rates(x + STEP * k3, target[2 * i + 2], target_rate[2 * i + 2], p)[0]
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return {k: np.array(v) for k, v in log.items()}


CHANNELS = {
    "steering_angle_rad": ("steer", "angle", "latency_robot"),
    "steering_torque_Nm": ("M_s", "robot_torque", "latency_robot"),
    "pinion_angle_rad": ("pin", "angle", None),
    "torsion_bar_torque_Nm": ("M_tb", "torque", "latency_bar_torque"),
    "rack_force_N": ("rack", "rack_force", "latency_rack"),
    "lateral_speed_mps": ("vy", "lateral_speed", "latency_imu"),
    "yaw_rate_radps": ("yaw", "yaw_rate", "latency_imu"),
    "lateral_acceleration_mps2": ("ay", "acceleration", "latency_imu"),
}


def logged(run, noise=None, rng=None):
    """Contract channels of one driven run; noise and latency added when asked for."""
    time, car = run["time"], run["car"]
    out = {"vehicle_speed_mps": np.full(time.size, car.speed)}
    for name, (signal, kind, latency) in CHANNELS.items():
        values = run["log"][signal]
        if noise is not None:
            delay = getattr(noise, latency) if latency else 0.0
            if delay:
                # A spline, because straight lines between samples would filter as well as delay.
                values = CubicSpline(time, values)(np.clip(time - delay, 0.0, time[-1]))
            values = values + rng.normal(0.0, getattr(noise, kind), values.size)
        out[name] = values
    out["sideslip_angle_rad"] = out["lateral_speed_mps"] / car.speed
    return out


def drive(cars, *, chirps=2, sines=1, duration=20.0, sweep_limit=SWEEP_LIMIT):
    """All runs of all cars, stepped as one batch: list of dict(name, manoeuvre, speed, car, time, log), no noise.

    Amplitudes give about 3 m/s2 at 0.2 Hz; repeats differ by a few percent, as robot-driven repeats do.
    """
    plan = []
    for car in cars:
        amplitude = np.deg2rad(amplitude_for(car))
        for kind, count, shape in (("frequency_response", chirps, chirp), ("steady_state", sines, sine)):
            largest = sweep_limit if shape is chirp else np.inf
            plan += [(car, kind, k, shape, min(amplitude, largest) * (1.0 + 0.03 * k)) for k in range(count)]
    log = simulate(
        [p[0] for p in plan], lambda t: np.column_stack([shape(t, size) for *_, shape, size in plan]), duration
    )
    time = np.arange(log["steer"].shape[0]) * STEP * LOG_EVERY
    return [
        {"name": f"{round(car.speed * 3.6):03d}_{kind}_{k + 1}", "manoeuvre": kind, "speed": car.speed, "car": car,
         "time": time, "log": {name: values[:, column] for name, values in log.items()}}
        for column, (car, kind, k, *_) in enumerate(plan)
    ]  # fmt: skip


def amplitude_for(car, acceleration=3.0):
    """Steering-wheel amplitude (deg) for a steady lateral acceleration, from the textbook understeer gradient."""
    wheelbase = car.l_f + car.l_r
    gradient = car.m / wheelbase * (car.l_r / car.C_f - car.l_f / car.C_r)
    per_tyre_angle = car.speed**2 / (wheelbase + gradient * car.speed**2)
    return min(float(np.rad2deg(acceleration * car.i_s / per_tyre_angle)), 200.0)


def with_friction(car, M_C=2.3, r=0.25):
    """The same car with Gaussian assist and Dahl friction instead of the linear gain."""
    return replace(car, nonlinear=True, M_C=M_C, assist_ratio=r)
