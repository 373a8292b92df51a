"""What a reference consists of: one row of parameters per speed, and the vehicle's known numbers.

The names are the paper's (T. Chugh et al., Vehicle System Dynamics, 2019, Tables 2 and 3); the
file keys (docs/formats.md, section 2) are these names with the unit appended.
"""

from typing import Annotated, NamedTuple

from steer_env.units import Quantity, quantities

_TABLE_2 = "bounds are an assumption that contains Table 2 with a wide margin"
_TABLE_3 = "bounds are an assumption that contains Table 3 with a wide margin"
_GEOMETRY = "assumption: from a small car to a laden van"


class ReferenceRow(NamedTuple):
    """Reference parameters at one speed (Eqs. 6, 9, 10, 13 to 15)."""

    speed_kmh: Annotated[float, Quantity("km/h", "speed", 0.5, 400.0, "assumption: any road vehicle")]
    J_ref: Annotated[float, Quantity("kg m2", "effective inertia at the pinion", 1e-4, 1.0, _TABLE_2)]
    b_ref: Annotated[float, Quantity("N m s/rad", "effective damping; may be negative", -10.0, 20.0, _TABLE_2)]
    k_gain: Annotated[float, Quantity("-", "linearised assist gain, K_assist = 1 + k_gain", 0.0, 50.0, _TABLE_2)]
    n_t: Annotated[float, Quantity("m", "mechanical + pneumatic trail", 1e-4, 0.5, _TABLE_2)]
    sigma_f: Annotated[float, Quantity("m", "front relaxation length", 1e-3, 5.0, _TABLE_2)]
    sigma_r: Annotated[float, Quantity("m", "rear relaxation length", 1e-3, 5.0, _TABLE_2)]
    C_f: Annotated[float, Quantity("N/rad", "front axle cornering stiffness", 5e3, 1e6, _TABLE_2)]
    C_r: Annotated[float, Quantity("N/rad", "rear axle cornering stiffness", 5e3, 1e6, _TABLE_2)]
    J_z: Annotated[float, Quantity("kg m2", "yaw inertia", 50.0, 5e4, _TABLE_2)]
    c_pin_on: Annotated[float, Quantity("N m/rad", "on-centre pinion stiffness", 1e-3, 1e3, _TABLE_3)]
    c_pin_off: Annotated[float, Quantity("N m/rad", "off-centre pinion stiffness, <= c_pin_on", 0.0, 1e3, _TABLE_3)]
    M_fric_C: Annotated[float, Quantity("N m", "Coulomb friction level", 0.0, 30.0, _TABLE_3)]
    sigma_assist: Annotated[float, Quantity("N m", "width of the Gaussian assist (Eq. 13)", 0.05, 30.0, _TABLE_3)]
    c_fric: Annotated[float, Quantity("N m/rad", "Dahl stiffness (Eq. 15)", 1.0, 1e5, _TABLE_3)]


class KnownVehicle(NamedTuple):
    """What is known of a vehicle without identification."""

    mass: Annotated[float, Quantity("kg", "vehicle mass as tested", 300.0, 2e4, _GEOMETRY)]
    cg_to_front_axle: Annotated[float, Quantity("m", "l_f", 0.3, 6.0, _GEOMETRY)]
    cg_to_rear_axle: Annotated[float, Quantity("m", "l_r", 0.3, 6.0, _GEOMETRY)]
    yaw_inertia: Annotated[float, Quantity("kg m2", "theoretical yaw inertia", 50.0, 5e4, _GEOMETRY)]
    steering_ratio: Annotated[float, Quantity("-", "i_s: pinion angle per road-wheel angle", 5.0, 40.0, _GEOMETRY)]
    pinion_ratio: Annotated[
        float,
        Quantity(
            "rad/m",
            "i_rp: pinion angle per rack travel",
            20.0,
            500.0,
            "assumption: 12 to 300 mm/rev",
        ),
    ]


_SUFFIX = {
    "-": "",
    "km/h": "",
    "kg": "_kg",
    "m": "_m",
    "kg m2": "_kgm2",
    "N m": "_Nm",
    "N/rad": "_N_per_rad",
    "N m/rad": "_Nm_per_rad",
    "N m s/rad": "_Nms_per_rad",
    "rad/m": "_rad_per_m",
}


def file_keys(table: type) -> dict[str, str]:
    """Return the key of each field in a file: its name and unit (speed_kmh has it already)."""
    return {name: name + _SUFFIX[quantity.unit] for name, quantity in quantities(table).items()}
