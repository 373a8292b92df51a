"""Bounds and start values of step I, shared by its steps and by the axle equations."""

LOW_HZ = 0.5  # "below 0.5 Hz is steady state", Section 3.4.2
BOUNDS: dict[str, tuple[float, float]] = {
    "C_f": (2e4, 6e5), "C_r": (2e4, 6e5),  # N/rad, small car to laden van
    "sigma_f": (0.01, 2.0), "sigma_r": (0.01, 2.0),  # m, to twice the paper's failed values
    "n_t": (0.001, 0.4),  # m
    "delay_imu": (-0.05, 0.10), "delay_rack": (-0.05, 0.10),  # s, CAN frames to a filtered GPS/IMU output
}  # fmt: skip
START = {"C_f": 1.2e5, "C_r": 1.2e5, "sigma_f": 0.3, "sigma_r": 0.3, "n_t": 0.08}
YAW_INERTIA_TOLERANCE = 0.05  # "within 5 % of its theoretical value", Section 4.1
