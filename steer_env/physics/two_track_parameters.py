"""Parameters of the two-track vehicle."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics.tyre import Tyre
from steer_env.units import Quantity


class TwoTrack(NamedTuple):
    """Defaults are an ordinary mid-size estate car, not the one of the paper."""

    m: Annotated[float, Quantity("kg", "total mass", 500.0, 5000.0, "mid-size estate with driver")] = 1640.0
    m_s: Annotated[float, Quantity("kg", "sprung mass", 400.0, 4800.0, "assumption: 90 % of the total")] = 1470.0
    J_z: Annotated[float, Quantity("kg m2", "yaw inertia", 300.0, 1e4, "assumption: 0.94 m l_f l_r")] = 2800.0
    J_x: Annotated[
        float,
        Quantity("kg m2", "roll inertia about the sprung mass centre", 50.0, 3e3, "assumption"),
    ] = 520.0
    l_f: Annotated[float, Quantity("m", "centre of gravity to front axle", 0.5, 3.0, "assumption")] = 1.24
    l_r: Annotated[float, Quantity("m", "centre of gravity to rear axle", 0.5, 3.0, "assumption")] = 1.46
    track_f: Annotated[float, Quantity("m", "front track", 1.0, 2.5, "assumption")] = 1.56
    track_r: Annotated[float, Quantity("m", "rear track", 1.0, 2.5, "assumption")] = 1.55
    roll_arm: Annotated[float, Quantity("m", "sprung mass centre above roll axis", 0.0, 1.0, "assumption")] = 0.34
    c_roll_f: Annotated[float, Quantity("N m/rad", "front roll stiffness", 1e3, 1e8, "assumption")] = 80000.0
    c_roll_r: Annotated[float, Quantity("N m/rad", "rear roll stiffness", 1e3, 1e8, "assumption")] = 58000.0
    b_roll_f: Annotated[float, Quantity("N m s/rad", "front roll damping", 0.0, 1e6, "assumption")] = 3600.0
    b_roll_r: Annotated[float, Quantity("N m s/rad", "rear roll damping", 0.0, 1e6, "assumption")] = 2900.0
    compliance_f: Annotated[
        float,
        Quantity("rad/N", "front steer lost per axle side force", -1e-5, 1e-5, "assumption: 0.07 deg/kN"),
    ] = 1.2e-6
    compliance_r: Annotated[
        float,
        Quantity(
            "rad/N",
            "rear steer lost per axle side force",
            -1e-5,
            1e-5,
            "assumption: toe-in under force",
        ),
    ] = -2.0e-7
    roll_steer_f: Annotated[float, Quantity("rad/rad", "front steer lost per roll", -0.5, 0.5, "assumption")] = 0.04
    roll_steer_r: Annotated[float, Quantity("rad/rad", "rear steer lost per roll", -0.5, 0.5, "assumption")] = -0.02
    ackermann: Annotated[float, Quantity("-", "share of full Ackermann geometry", 0.0, 1.5, "assumption")] = 0.6
    mechanical_trail: Annotated[
        float, Quantity("m", "caster trail at the ground", 0.0, 0.1, "assumption: 7 deg caster")
    ] = 0.040
    i_s: Annotated[float, Quantity("-", "pinion angle / road-wheel angle", 5.0, 40.0, "assumption")] = 16.2
    front: Tyre = Tyre()
    rear: Tyre = Tyre(stiffness_max=86000.0, trail=0.036)
