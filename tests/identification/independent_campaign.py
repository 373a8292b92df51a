"""Campaigns in memory from ``independent_car``, made once per session."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from identification.campaign import Campaign, Run
from identification.campaign_toml import KnownSteering
from identification.identify import Options, identify
from identification.result import SpeedResult
from steer_env.plants.reference_row import KnownVehicle
from tests.identification.independent_car import Car, Noise, drive, logged, with_friction

SPEEDS_KMH = (45.0, 75.0, 105.0)
LATENCIES = {
    "latency_imu": 0.012,
    "latency_rack": -0.006,
    "latency_bar_torque": 0.003,
    "latency_robot": -0.006,
}


@cache
def driven() -> tuple[list[Car], list[Car], list[dict]]:
    """Linear cars and cars with friction, and the clean runs of all of them."""
    linear_cars = [Car(v / 3.6) for v in SPEEDS_KMH]
    friction_cars = [with_friction(car) for car in linear_cars]
    return linear_cars, friction_cars, drive([*linear_cars, *friction_cars], chirps=2, sines=2)


def campaign_of(cars, noise=None, rng=None, runs=None) -> Campaign:
    """The logs of some of the driven cars as a campaign; all runs are for identification."""
    runs = [
        Run(r["name"], r["manoeuvre"], r["speed"], "identify", r["time"], 0.01, logged(r, noise, rng))
        for r in (runs or driven()[2])
        if r["car"] in cars
    ]
    car = cars[0]
    vehicle = KnownVehicle(car.m, car.l_f, car.l_r, car.J_z, car.i_s, car.i_rp)
    steering = KnownSteering(car.J_s, car.J_rob, car.b_s, car.c_tb, car.b_tb)
    return Campaign("independent", "vehicle", vehicle, steering, None, runs, {}, Path("memory"))


@cache
def linear() -> tuple[list[Car], Campaign]:
    """Noise-free, linear assist, no friction: everything in the paper's steps is exact here."""
    cars = driven()[0]
    return cars, campaign_of(cars)


@cache
def frictional() -> tuple[list[Car], Campaign]:
    """Noise-free, Gaussian assist, 2.3 N m of friction."""
    cars = driven()[1]
    return cars, campaign_of(cars)


@cache
def noisy(seed: int = 0) -> tuple[list[Car], Campaign]:
    """As frictional, with sensor noise and a lag per sensor group."""
    cars = driven()[1]
    return cars, campaign_of(cars, Noise(**LATENCIES), np.random.default_rng(seed))


@cache
def small_sweep() -> tuple[list[Car], Campaign]:
    """Constant assist gain and 2.3 N m of friction at 105 km/h, the sweep with 0.1 rad at the wheel, noisy."""
    cars = [Car(105.0 / 3.6, M_C=2.3)]
    runs = drive(cars, chirps=2, sines=2, sweep_limit=0.1)
    return cars, campaign_of(cars, Noise(), np.random.default_rng(5), runs)


@cache
def identified(which: str, slip: str = "relaxed") -> list[SpeedResult]:
    """Per-speed results of one of the campaigns above by its name."""
    _, campaign = {"linear": linear, "frictional": frictional, "noisy": noisy}[which]()
    return identify(campaign, Options(("per-speed",), slip)).modes["per-speed"]


def without(campaign: Campaign, *channels: str) -> Campaign:
    """The campaign with channels taken out of every run."""
    runs = [
        replace(r, channels={n: v for n, v in r.channels.items() if n not in channels})
        for r in campaign.runs
    ]
    return replace(campaign, runs=runs)
