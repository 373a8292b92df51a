"""steer-env rig excite: torques that make a motor on a bench tell its inertia, damping and friction, recorded."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import click

from experiments.cli_options import common_options
from experiments.rig_options import arm_options, bus_options, fresh, unlocked

CONFIRM = (
    "The motor will turn the wheel to and fro by itself with up to {cap:g} N m. "
    "Nobody holds it, hands clear and the rig fixed? Type ARM"
)
STIFFNESS, DAMPING = 1.5, 0.05  # N m/rad, N m s/rad: weak, so that the wheel stays near its middle
SWEEP_HZ = (0.2, 10.0)
SINE_HZ, STEP_S, REST_S = 0.25, 2.0, 2.0
SMALL, LARGE, HOLD = 0.3, 0.7, 0.6  # of the torque cap


class Feed(NamedTuple):
    """A torque over time: name, the campaign's manoeuvre, and share of the torque cap at a time, of a length, in s."""

    name: str
    manoeuvre: str
    share: Callable[[float, float], float]


def _sweep(t: float, length: float) -> float:
    low, high = SWEEP_HZ
    return math.sin(2.0 * math.pi * (low * t + 0.5 * (high - low) / length * t * t))


def _sine(t: float, length: float) -> float:
    return math.sin(2.0 * math.pi * SINE_HZ * t)


def _steps(t: float, length: float) -> float:
    """Held to one side, then to the other; let go at the end."""
    if t > length - REST_S:
        return 0.0
    return 1.0 if t % (2.0 * STEP_S) < STEP_S else -1.0


FEEDS = (
    Feed("sweep_small", "torque_sweep", lambda t, length: SMALL * _sweep(t, length)),
    Feed("sweep_large", "torque_sweep", lambda t, length: LARGE * _sweep(t, length)),
    Feed("sine_small", "steady_state", lambda t, length: SMALL * _sine(t, length)),
    Feed("sine_large", "steady_state", lambda t, length: LARGE * _sine(t, length)),
    Feed("release", "release", lambda t, length: HOLD * _steps(t, length)),
)


class Excitation:
    """A controller that gives a feed of at most ``cap`` N m over ``length`` s, held back by a weak spring."""

    def __init__(self, feed: Feed, cap: float, length: float) -> None:
        self.feed, self.cap, self.length = feed, cap, length
        self.reset(1e-3)

    def reset(self, period: float) -> None:
        """Begin anew; ``period`` in s."""
        self._period, self._count = period, 0

    def __call__(self, observation: Any) -> float:
        """Torque in N m."""
        t = self._count * self._period
        self._count += 1
        held = STIFFNESS * observation.pinion_angle + DAMPING * observation.pinion_rate
        return self.cap * self.feed.share(t, self.length) - held


@click.command()
@bus_options
@click.option(
    "--seconds", type=click.FloatRange(12.0, 120.0), default=16.0, show_default=True, metavar="S",
    help="Of each of the five torques.",
)  # fmt: skip
@click.option(
    "--repeats", type=click.IntRange(1, 20), default=3, show_default=True, metavar="N",
    help="Of each; the last is held out to judge by.",
)  # fmt: skip
@arm_options
@common_options
@click.pass_context
def command(
    ctx: click.Context, motor: str, settings: dict[str, Any], interface: str, channel: str, bitrate: int | None,
    port: int, seconds: float, repeats: int, torque_cap: float | None, patience: float, no_watchdog: bool, mf4: bool,
    arm: bool, yes: bool, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool,
) -> None:  # fmt: skip
    """Turn a free wheel to and fro by sweeps, slow sines and steps of torque, to identify the bench itself.

    Four minutes with the defaults. Writes a campaign of kind rig: 'steer-env identify OUT' gives inertia, damping,
    friction and delay of what is on the motor, 'steer-env gap OUT' what such a model misses. Nobody may hold the wheel.
    """
    from experiments.rig_episodes import play, recorded, report

    del jobs
    options = {
        "motor": motor, "motor_options": settings, "interface": interface, "channel": channel, "port": port,
        "bitrate": bitrate, "torque_cap": torque_cap, "watchdog": False if no_watchdog else None,
        "patience": patience, "manoeuvre": "standstill", "driver": "hands_off", "duration": seconds,
    }  # fmt: skip
    played = []
    with recorded(fresh(ctx, out), options, "impedance", "rig", mf4) as rig:
        inside = rig.env.unwrapped
        cap = inside.connection.limits_of(inside.connection.codec()).torque_cap
        plan = [(feed, repeat) for feed in FEEDS for repeat in range(repeats)]
        for k, (feed, repeat) in enumerate(plan):
            unlocked(inside, CONFIRM, arm, yes or k > 0)
            rig.env.manoeuvre = feed.manoeuvre
            rig.env.role = "validate" if 0 < repeat == repeats - 1 else "identify"
            law = Excitation(feed, cap, seconds)
            played.append(play(rig.env, law, seed, f"{k + 1} of {len(plan)}, {feed.name}", quiet))
            if played[-1].ended.startswith("tripped"):
                break
    report(ctx, played, rig, as_json)
