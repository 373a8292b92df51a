"""Who holds the wheel: a grid of arms, hands off, a torque source and the steering robot."""

from __future__ import annotations

from steer_env.physics.driver import Driver

DRIVERS: dict[str, Driver] = {
    "hands_off": Driver(J=0.0, b=0.0, k=0.0, torque_limit=0.0),
    "one_hand_light": Driver(J=0.05, b=0.3, k=3.0),
    "relaxed": Driver(J=0.1, b=0.6, k=7.0),
    "tense": Driver(J=0.135, b=2.0, k=47.0),
    # A hand that gives torque and no impedance of its own: the cleanest excitation for a frequency
    # response.
    "torque_source": Driver(J=0.0, b=0.0, k=0.0),
    # Position servo of about 12 Hz with rate feed-forward on wheel and robot inertia together (0.07
    # kg m2).
    "robot": Driver(J=0.03, b=8.0, k=400.0, torque_limit=60.0),
}
