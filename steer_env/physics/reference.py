"""The haptic reference (Eqs. 4 and 10) and its two generators (Fig. 2).

    J_ref d'' + b_ref d' + M_rack + c_extra d + M_ref,fric = M_eff,   M_eff = K_assist(M_tb) M_tb

Admittance: torsion-bar torque in, pinion motion out. Impedance: pinion motion in, torsion-bar torque out. Both use the
same M_rack and the same friction, so one undoes the other.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from steer_env.physics import vehicle
from steer_env.physics._jit import scalar
from steer_env.physics.assist import assist, inverse_assist
from steer_env.physics.friction import dahl_step
from steer_env.physics.vehicle import SingleTrack, SingleTrackState
from steer_env.units import Quantity

_T2 = "Table 2, 75 km/h"
_T3 = "Table 3, 75 km/h"


class ReferenceParameters(NamedTuple):
    """One speed's reference with its own single track; defaults are the published row of 75 km/h with set R."""

    J_ref: Annotated[float, Quantity("kg m2", "reference inertia", 1e-3, 1.0, _T2)] = 0.0613
    b_ref: Annotated[float, Quantity("N m s/rad", "reference damping", -5.0, 20.0, _T2)] = 1.006
    k_gain: Annotated[float, Quantity("-", "linearised basic assist", 0.0, 60.0, _T2)] = 2.647
    M_fric_C: Annotated[float, Quantity("N m", "Coulomb friction at the pinion", 0.0, 20.0, _T3)] = 2.494
    c_fric: Annotated[float, Quantity("N m/rad", "Dahl stiffness", 1.0, 1e5, "assumption")] = 200.0
    r: Annotated[float, Quantity("-", "c_pin_off / c_pin_on", 0.0, 1.0, _T3)] = 6.979 / 35.482
    sigma: Annotated[float, Quantity("N m", "width of the on-centre region", 0.1, 20.0, "assumption")] = 1.8
    c_extra: Annotated[
        float, Quantity("N m/rad", "pinion stiffness beyond the single track's", -50.0, 50.0, "assumption: none")
    ] = 0.0
    relaxed: Annotated[float, Quantity("-", "1: M_rack from relaxed slip, 0: kinematic (Eq. 10)", 0, 1, "Eq. 10")] = 0.0
    linear: Annotated[float, Quantity("-", "1: K = 1 + k_gain and no friction, 0: Eqs. 14-15", 0, 1, "Fig. 9")] = 0.0
    m: Annotated[float, Quantity("kg", "vehicle mass", 500.0, 10000.0, "set R")] = SingleTrack().m
    l_f: Annotated[float, Quantity("m", "centre of gravity to front axle", 0.3, 5.0, "set R")] = SingleTrack().l_f
    l_r: Annotated[float, Quantity("m", "centre of gravity to rear axle", 0.3, 5.0, "set R")] = SingleTrack().l_r
    J_z: Annotated[float, Quantity("kg m2", "yaw inertia", 300.0, 60000.0, _T2)] = SingleTrack().J_z
    C_f: Annotated[float, Quantity("N/rad", "front axle cornering stiffness", 1e4, 1e6, _T2)] = SingleTrack().C_f
    C_r: Annotated[float, Quantity("N/rad", "rear axle cornering stiffness", 1e4, 1e6, _T2)] = SingleTrack().C_r
    sigma_f: Annotated[float, Quantity("m", "front relaxation length", 0.005, 3.0, _T2)] = SingleTrack().sigma_f
    sigma_r: Annotated[float, Quantity("m", "rear relaxation length", 0.005, 3.0, _T2)] = SingleTrack().sigma_r
    n_t: Annotated[float, Quantity("m", "steering trail", 0.0, 0.5, _T2)] = SingleTrack().n_t
    i_s: Annotated[float, Quantity("-", "pinion angle / road-wheel angle", 5.0, 30.0, "set R")] = SingleTrack().i_s


class ReferenceState(NamedTuple):
    """State of a generator: pinion angle (rad) and rate (rad/s), single-track state, friction torque (N m)."""

    pinion_angle: float
    pinion_rate: float
    lateral_speed: float
    yaw_rate: float
    slip_front: float
    slip_rear: float
    friction: float


@scalar
def single_track_of(p: ReferenceParameters) -> SingleTrack:
    """The vehicle inside the reference."""
    return SingleTrack(p.m, p.l_f, p.l_r, p.J_z, p.C_f, p.C_r, p.sigma_f, p.sigma_r, p.n_t, p.i_s)


@scalar
def reference_load(angle: float, x: SingleTrackState, speed: float, p: ReferenceParameters) -> float:
    """M_rack + c_extra d in N m; slip kinematic as row 2 of Eq. 10 prints it, or relaxed as Eq. 9 says."""
    track = single_track_of(p)
    kinematic = vehicle.kinematic_front_slip(x, angle * (1.0 / p.i_s), speed, track)
    slip = x.slip_front if p.relaxed > 0.5 else kinematic
    return vehicle.rack_torque(slip, track) + p.c_extra * angle


@scalar
def reference_rates(
    angle: float, rate: float, x: SingleTrackState, M_eff: float, M_fric: float, speed: float, p: ReferenceParameters
) -> tuple[float, SingleTrackState]:
    """Pinion acceleration in rad/s2 (Eq. 4) and the single track's derivatives (Eq. 6)."""
    acceleration = (M_eff - M_fric - reference_load(angle, x, speed, p) - p.b_ref * rate) * (1.0 / p.J_ref)
    return acceleration, vehicle.single_track_rates(x, angle * (1.0 / p.i_s), speed, single_track_of(p))


@scalar
def effective_torque(M_tb: float, p: ReferenceParameters) -> float:
    """M_eff in N m: Eq. 14, or the linearised assist."""
    if p.linear > 0.5:
        return (1.0 + p.k_gain) * M_tb
    return assist(M_tb, p.r, p.sigma)


@scalar
def torsion_bar_torque_for(M_eff: float, p: ReferenceParameters) -> float:
    """M_tb in N m whose assist is M_eff: the inverse of ``effective_torque``."""
    if p.linear > 0.5:
        return M_eff * (1.0 / (1.0 + p.k_gain))
    return inverse_assist(M_eff, p.r, p.sigma)
