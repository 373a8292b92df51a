"""A vehicle campaign as the gap workflow sees it: the seed's model, led by the steering angle, for all channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.campaign import Campaign, KnownSteering, KnownVehicle, require
from identification.frf import Floats
from identification.gap.model import Present, Record, Unknown, Values
from identification.gap.repeats import records_of
from identification.gap.vehicle_kernel import RECORD, Steering, rollout
from identification.motion import band_limited
from steer_env.errors import InputError
from steer_env.physics.effects import EFFECTS, Effect
from steer_env.physics.effects.vehicle_ports import MECHANICAL, effect_row
from steer_env.physics.vehicle import SingleTrack

LEAD = "steering_angle_rad"
OUTPUTS = (
    "torsion_bar_torque_Nm",
    "pinion_angle_rad",
    "steering_torque_Nm",
    "rack_force_N",
    "yaw_rate_radps",
    "lateral_acceleration_mps2",
    "lateral_speed_mps",
    "sideslip_angle_rad",
)
# Ordinary lateness against the steering angle, by who logs a channel: the car's bus as a whole, the robot's torque
# sensor, strain gauges. A few milliseconds between loggers are nothing that a model misses.
LATE_BY = {"steering_torque_Nm": "delay_wheel_torque", "rack_force_N": "delay_rack_force"}
# s of the Runge-Kutta step: errs by 0.1 % of the torsion-bar torque in a sweep, a tenth of the noise; and radians of
# the front tyre's relaxation that a step may cover (2.8 is where it turns unstable).
LONGEST_STEP, LARGEST_TURN = 3.4e-3, 1.8
INPUT_HZ = 38.0  # of the steering angle, as far as 100 Hz logs hold it
BAND_HZ = 15.0  # outputs are judged up to here: three times the highest frequency driven
# What a control unit schedules over speed. In a sweep its friction compensation, which works on a filtered rate, fades:
# ``sweep_friction`` is the factor on the Coulomb level there.
SCHEDULED = ("J_ref", "b_ref", "r", "M_fric_C", "sweep_friction")


def unknowns_of(vehicle: KnownVehicle, steering: KnownSteering, speeds_kmh: tuple[float, ...]) -> tuple[Unknown, ...]:
    """Nominal parameters: physical constants shared by all speeds, and what a control unit schedules, per speed.

    Starts and spreads are our assumptions: typical cars, wide enough (one standard deviation is a factor of 1.4 to 2)
    for any road vehicle; the yaw inertia may leave its theoretical value by 2.5 %.
    """
    load = vehicle.mass * 9.81 / (vehicle.cg_to_front_axle + vehicle.cg_to_rear_axle)
    wheel = steering.wheel_inertia + steering.robot_inertia
    # First what a logger or the wheel's mass makes of the motion: a fit's columns then find the motion still known.
    shared = [
        Unknown("J_wheel", wheel, 0.2 * wheel, 3.0 * wheel, 0.3),
        Unknown("delay_bus", 0.0, -0.02, 0.04, 0.004, log=False),
        Unknown("delay_wheel_torque", 0.0, -0.03, 0.03, 0.004, log=False),
        Unknown("delay_rack_force", 0.0, -0.03, 0.03, 0.004, log=False),
        Unknown("C_f", 14.0 * load * vehicle.cg_to_rear_axle, 1e4, 2e6, 0.5),
        Unknown("C_r", 16.0 * load * vehicle.cg_to_front_axle, 1e4, 2e6, 0.5),
        Unknown("n_t", 0.07, 0.005, 0.5, 0.5),
        Unknown("sigma_f", 0.3, 0.03, 3.0, 0.8),
        Unknown("sigma_r", 0.4, 0.03, 3.0, 0.8),
        Unknown("J_z", vehicle.yaw_inertia, 0.9 * vehicle.yaw_inertia, 1.1 * vehicle.yaw_inertia, 0.025),
        Unknown("c_fric", 200.0, 5.0, 1e4, 0.8),
        Unknown("sigma_assist", 1.8, 0.3, 12.0, 0.5),
    ]
    scheduled = [
        ("J_ref", 0.06, 0.005, 0.6, 0.5, True),
        ("b_ref", 0.7, -3.0, 10.0, 0.8, False),
        ("r", 0.2, 0.01, 1.2, 0.7, True),
        ("M_fric_C", 2.0, 0.02, 15.0, 0.8, True),
        ("sweep_friction", 1.0, 0.3, 3.0, 0.15, True),
    ]
    return (
        *shared,
        *(
            Unknown(f"{name}@{v:g}", start, low, high, prior, log, v)
            for v in speeds_kmh
            for name, start, low, high, prior, log in scheduled
        ),
    )


@dataclass
class VehicleModel:
    """The seed's model of one campaign (``model.Model``)."""

    records: tuple[Record, ...]
    vehicle: KnownVehicle
    steering: KnownSteering
    unknowns: tuple[Unknown, ...]
    effects: Mapping[str, Effect]
    channels: tuple[str, ...]
    band_Hz: float = BAND_HZ
    _inputs: dict[tuple[str, float, int], tuple[Floats, ...]] = field(default_factory=dict, repr=False)
    _motions: dict[str, tuple[Any, Floats]] = field(default_factory=dict, repr=False)

    def simulate(self, record: Record, values: Values, present: Present) -> dict[str, Floats]:
        """Output channels [n] of a record; see ``model.Model``."""
        substeps = _substeps(record.dt, record.speed / min(values["sigma_f"], values["sigma_r"]))
        _, _, rate, acceleration = self._input(record, substeps)
        out = self._motion(record, values, present, substeps)
        column = {name: out[:, k] for k, name in enumerate(RECORD)}
        wheel = values["J_wheel"] * acceleration + self.steering.wheel_damping * rate
        speed = max(record.speed, 0.1)
        true = {
            "torsion_bar_torque_Nm": column["torsion_bar_torque"],
            "pinion_angle_rad": column["pinion_angle"],
            "steering_torque_Nm": column["column_torque"] + wheel,
            "rack_force_N": self.vehicle.pinion_ratio * column["rack_torque"],
            "yaw_rate_radps": column["yaw_rate"],
            "lateral_acceleration_mps2": column["lateral_acceleration"],
            "lateral_speed_mps": column["lateral_speed"],
            "sideslip_angle_rad": np.arctan2(column["lateral_speed"], speed),
        }
        return {name: self._logged(name, true[name], record.dt, values, present) for name in record.outputs}

    def _motion(self, record: Record, values: Values, present: Present, substeps: int) -> Floats:
        """What the car does [n, len(RECORD)]; a record's last one is kept: loggers' errors do not change it."""
        mechanical = {name: parameters for name, parameters in present.items() if name in MECHANICAL}
        offset = present.get("angle_offset", {}).get("rad", 0.0)
        p, car = self._steering(record, values), self._car(values)
        asked = (p, car, offset, substeps, mechanical)
        known, out = self._motions.get(record.name, (None, None))
        if out is None or known != asked:
            fine, fine_rate, _, _ = self._input(record, substeps)
            row = effect_row(mechanical) if mechanical else None
            out = rollout(fine - offset, fine_rate, record.dt / substeps, substeps, record.speed, p, car, row)
            self._motions[record.name] = (asked, out)
        return out

    def judged(self, outputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Twist and wheel-side torque as differences, in which road and motion are gone; one of v_y and sideslip."""
        made = dict(outputs)
        torque = outputs.get("torsion_bar_torque_Nm")
        if torque is not None and "pinion_angle_rad" in made:
            made["pinion_angle_rad"] = made["pinion_angle_rad"] + torque / self.steering.torsion_bar_stiffness
        if torque is not None and "steering_torque_Nm" in made:
            made["steering_torque_Nm"] = made["steering_torque_Nm"] - torque
        if "lateral_speed_mps" in made:
            made.pop("sideslip_angle_rad", None)
        return made

    def states(self, record: Record) -> dict[str, Floats]:
        """Steering angle and rate, torsion-bar torque or steering torque, lateral acceleration or yaw rate."""
        _, _, rate, _ = self._input(record, _substeps(record.dt, 0.0))
        found = {"steering angle": record.inputs[LEAD], "steering rate": rate}
        for label, names in (
            ("torque", ("torsion_bar_torque_Nm", "steering_torque_Nm")),
            ("lateral acceleration", ("lateral_acceleration_mps2", "yaw_rate_radps")),
        ):
            measured = next((record.outputs[name] for name in names if name in record.outputs), None)
            if measured is not None:
                found[label] = measured
        return found

    def _logged(self, name: str, true: Floats, dt: float, values: Values, present: Present) -> Floats:
        """What a logger makes of a true signal: gain, offset, lateness."""
        delay = values[LATE_BY.get(name, "delay_bus")]
        signal = true
        for effect, parameters in present.items():
            sensor = self.effects[effect].sensor if effect in self.effects else EFFECTS["vehicle"][effect].sensor
            if sensor is None or name not in sensor.channels:
                continue
            delay += parameters[sensor.delay] if sensor.delay else 0.0
            signal = signal * parameters[sensor.gain] if sensor.gain else signal
            signal = signal + parameters[sensor.offset] if sensor.offset else signal
        if delay == 0.0:
            return signal
        return late(signal, delay / dt)

    def _steering(self, record: Record, values: Values) -> Steering:
        here = {name: values[f"{name}@{record.group:g}"] for name in SCHEDULED}
        if record.manoeuvre == "frequency_response":
            here["M_fric_C"] *= here["sweep_friction"]
        return Steering(
            here["J_ref"], here["b_ref"], here["r"], values["sigma_assist"], here["M_fric_C"], values["c_fric"],
            self.steering.torsion_bar_stiffness, self.steering.torsion_bar_damping,
        )  # fmt: skip

    def _car(self, values: Values) -> SingleTrack:
        v = self.vehicle
        return SingleTrack(
            v.mass, v.cg_to_front_axle, v.cg_to_rear_axle, values["J_z"], values["C_f"], values["C_r"],
            values["sigma_f"], values["sigma_r"], values["n_t"], v.steering_ratio,
        )  # fmt: skip

    def _input(self, record: Record, substeps: int) -> tuple[Floats, ...]:
        """Steering angle and rate at steps and midpoints; rate and acceleration [n] at samples."""
        key = (record.name, record.dt, substeps)
        if key not in self._inputs:
            angle = band_limited(record.inputs[LEAD], record.dt, min(INPUT_HZ, 0.38 / record.dt))
            rate = angle.rate()
            per_sample = 2 * substeps
            # The wheel's inertia makes torque of the angle's noise, so it sees no more of it than is judged.
            slow = band_limited(record.inputs[LEAD], record.dt, min(BAND_HZ, 0.38 / record.dt)).rate()
            self._inputs[key] = (
                angle.fine(per_sample), rate.fine(per_sample), slow.signal(), slow.rate().signal(),
            )  # fmt: skip
        return self._inputs[key]


def late(signal: Floats, samples: float) -> Floats:
    """A signal [n] delayed by any number of samples, by a cubic through the four nearest; held at its ends."""
    whole = int(np.floor(samples))
    s = samples - whole
    taps = (
        -s * (1.0 - s) * (1.0 + s) / 6.0,
        s * (1.0 + s) * (2.0 - s) / 2.0,
        (1.0 + s) * (1.0 - s) * (2.0 - s) / 2.0,
        -s * (1.0 - s) * (2.0 - s) / 6.0,
    )
    reach = abs(whole) + 3
    wide = np.concatenate([np.full(reach, signal[0]), signal, np.full(reach, signal[-1])])
    delayed = np.zeros(signal.size)
    for tap, start in zip(taps, range(reach - whole - 2, reach - whole + 2), strict=True):
        delayed += tap * wide[start : start + signal.size]
    return delayed


def _substeps(dt: float, relaxation: float) -> int:
    """Runge-Kutta steps per sample; ``relaxation`` is the fastest tyre's speed over relaxation length, 1/s."""
    longest = min(LONGEST_STEP, LARGEST_TURN / max(relaxation, 1e-9))
    return max(1, int(np.ceil(dt / longest - 1e-9)))


def vehicle_model(campaign: Campaign) -> VehicleModel:
    """Records and unknowns of a vehicle campaign; an ``InputError`` where the steering angle or every output lacks."""
    if campaign.vehicle is None or campaign.steering is None:
        raise InputError(f"{campaign.folder}: kind", f"'{campaign.kind}' is not 'vehicle'", "give a vehicle campaign")
    for run in campaign.runs:
        require(run, [LEAD], "the gap workflow, which leads its simulation by the steering angle,")
    records = records_of(campaign.runs, LEAD, (LEAD,), OUTPUTS)
    channels = tuple(name for name in OUTPUTS if any(name in record.outputs for record in records))
    if not channels:
        wanted = f"log some of {', '.join(OUTPUTS)}"
        raise InputError(f"{campaign.folder}: runs", "no run has an output channel", wanted)
    speeds = tuple(sorted({record.group for record in records}))
    measured = set(channels) | {LEAD}
    effects = {name: effect for name, effect in EFFECTS["vehicle"].items() if measured.issuperset(effect.needs)}
    unknowns = unknowns_of(campaign.vehicle, campaign.steering, speeds)
    return VehicleModel(records, campaign.vehicle, campaign.steering, unknowns, effects, channels)
