"""Cars for blind tests: what the catalogue knows is taken out of them, everything else is left in.

The virtual car has front compliance and wheel-side friction, which are effects of the catalogue, and tyres whose trail
falls with slip, which nearly is one. A test that hides an effect must know what else there is to be found.
"""

from __future__ import annotations

import numpy as np

from steer_env.physics.tyre import Tyre
from steer_env.testcar.parameters import VirtualCar

# Of a tyre whose trail hardly falls with slip; what is left (load transfer, curvature) takes about 4 % off the torque
# at 4 m/s2.
TRAIL_SLOPE = 2.0


def plain_car() -> VirtualCar:
    """The virtual car without front compliance, wheel-side friction and trail drop."""
    car = VirtualCar()
    vehicle = car.vehicle._replace(
        compliance_f=0.0, front=_steady(car.vehicle.front), rear=_steady(car.vehicle.rear)
    )
    return car._replace(vehicle=vehicle, steering=car.steering._replace(M_s_fric=0.0))


def random_car(rng: np.random.Generator) -> VirtualCar:
    """Another plain car: masses, axles, tyres, bar, friction and boost drawn with spreads of 4 to 20 %."""
    car = plain_car()

    def drawn(value: float, spread: float) -> float:
        return float(value * np.exp(spread * rng.standard_normal()))

    v, s, c = car.vehicle, car.steering, car.calibration
    mass = drawn(1.0, 0.12)
    vehicle = v._replace(
        m=v.m * mass,
        m_s=v.m_s * mass,
        J_z=drawn(v.J_z * mass, 0.04),
        J_x=drawn(v.J_x * mass, 0.10),
        l_f=drawn(v.l_f, 0.05),
        l_r=drawn(v.l_r, 0.05),
        c_roll_f=drawn(v.c_roll_f * mass, 0.10),
        c_roll_r=drawn(v.c_roll_r * mass, 0.10),
        mechanical_trail=drawn(v.mechanical_trail, 0.15),
        i_s=drawn(v.i_s, 0.06),
        front=_drawn_tyre(v.front, drawn(1.0, 0.10) * mass, drawn(1.0, 0.15), mass),
        rear=_drawn_tyre(v.rear, drawn(1.0, 0.10) * mass, drawn(1.0, 0.15), mass),
    )
    steering = s._replace(
        c_tb=drawn(s.c_tb, 0.12),
        J_pin=drawn(s.J_pin, 0.10),
        b_pin=drawn(s.b_pin, 0.20),
        M_fric=drawn(s.M_fric, 0.20),
        c_fric=drawn(s.c_fric, 0.20),
    )
    boost = drawn(1.0, 0.10)
    calibration = c._replace(
        off_centre_ratio=tuple(boost * r for r in c.off_centre_ratio),
        on_centre_width=drawn(c.on_centre_width, 0.08),
    )
    return car._replace(vehicle=vehicle, steering=steering, calibration=calibration)


def _steady(tyre: Tyre) -> Tyre:
    return tyre._replace(trail_slope=TRAIL_SLOPE)


def _drawn_tyre(tyre: Tyre, stiffness: float, relaxation: float, load: float) -> Tyre:
    return tyre._replace(
        stiffness_max=tyre.stiffness_max * stiffness,
        relaxation=tyre.relaxation * relaxation,
        load_of_max=tyre.load_of_max * load,
        load_nominal=tyre.load_nominal * load,
    )
