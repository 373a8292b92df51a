"""Random and mutated frames into every decoder; an independent oracle says what may be believed.

    python -m experiments.rig_fuzz --frames 1000000

A frame accepted wrongly is one out of which comes a sample or a status that its published layout does not hold; one
refused wrongly is the opposite. Both must be zero.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from experiments.cli_options import common_options, print_json, print_table, progress
from experiments.rig_oracles import ORACLES, SETTINGS, Truth
from steer_env.rig.frame import Frame
from steer_env.rig.motors import MOTORS, make
from steer_env.rig.motors.motor import DriveStatus, Rejected, Sample

BLOCK = 10_000
SPECIAL = [struct.pack("<f", value) for value in (math.nan, math.inf, -math.inf, 1e38, -1e-40, 159.2)]
_MUTATIONS = 9


class Fuzzed(NamedTuple):
    """Counts of one decoder; ``example`` is a frame of the first error, or None."""

    frames: int
    believed: int
    rejected: int
    accepted_wrongly: int
    refused_wrongly: int
    example: Frame | None


def fuzz(name: str, frames: int, seed: int, advance: Any = None) -> Fuzzed:
    """Send that many frames into a motor's decoder; raises whatever the decoder raises."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(list(MOTORS).index(name),)))
    motor, oracle = make(name, **SETTINGS[name]), ORACLES[name]
    pool = valid_frames(name, seed)
    counts = [0, 0, 0, 0]
    example = None
    done = 0
    while done < frames:
        block = min(BLOCK, frames - done)
        draws = rng.integers(0, 1 << 31, size=(block, 6))
        noise = rng.bytes(64 * block)
        for k in range(block):
            frame = mutated(pool, [int(value) for value in draws[k]], noise[64 * k : 64 * k + 64])
            said = motor.decode(frame)
            truth = oracle(frame)
            believed = [message for message in said if not isinstance(message, Rejected)]
            counts[0] += bool(believed)
            counts[1] += any(isinstance(message, Rejected) for message in said)
            wrong = bool(believed) and not agrees(believed, truth)
            missed = truth is not None and not believed
            counts[2] += wrong
            counts[3] += missed
            if (wrong or missed) and example is None:
                example = frame
        done += block
        if advance is not None:
            advance(block, note=name)
    return Fuzzed(frames, counts[0], counts[1], counts[2], counts[3], example)


def agrees(messages: list[Any], truth: Truth | None) -> bool:
    """Whether what was believed is what the layout says."""
    if truth is None:
        return False
    states = [message.state for message in messages if isinstance(message, DriveStatus)]
    samples = [message for message in messages if isinstance(message, Sample)]
    if states != ([truth.state] if truth.state else []) or bool(samples) == math.isnan(truth.angle):
        return False
    return all(
        abs(sample.angle - truth.angle) <= 1e-9 * max(1.0, abs(truth.angle))
        and (math.isnan(truth.torque) or abs(sample.torque - truth.torque) <= 1e-9)
        for sample in samples
    )


def valid_frames(name: str, seed: int) -> list[Frame]:
    """What a virtual drive sends while it is brought up, moves and trips."""
    from steer_env.rig.virtual.motor import VirtualMotor

    motor, virtual = make(name, **SETTINGS[name]), VirtualMotor(name, seed, **SETTINGS[name])
    found: list[Frame] = []
    frames = motor.poll_frames()
    for k in range(400):
        if k == 300:
            virtual.drive.trip(virtual.drive.fault)
        statuses = []
        for received in virtual.exchange(frames, 1e-3):
            found.append(received.frame)
            statuses += [message for message in motor.decode(received.frame) if isinstance(message, DriveStatus)]
        climbing = bool(statuses) and statuses[-1].state in ("off", "ready")
        step = motor.bring_up(statuses[-1]) if climbing else motor.torque_frames(math.sin(0.05 * k))
        frames = step or motor.poll_frames()
    return found


def mutated(pool: list[Frame], draws: list[int], noise: bytes) -> Frame:
    """A frame of the pool with one thing, or everything, made wrong; one in nine stays as it is."""
    pick, kind, where, much, bit, flags = draws
    frame = pool[pick % len(pool)]
    data = bytearray(frame.data)
    match kind % _MUTATIONS:
        case 1:  # a few bits
            for k in range(1 + much % 4):
                at = (where >> 3 * k) % (8 * len(data))
                data[at // 8] ^= 1 << at % 8
        case 2:  # a byte
            data[where % len(data)] = bit & 0xFF
        case 3:  # another length
            length = much % 65 if frame.fd else much % 9
            data = bytearray((bytes(data) + noise)[:length])
        case 4:  # another identifier
            frame = frame._replace(identifier=where % 0x800 if much % 2 else frame.identifier ^ (1 << where % 11))
        case 5:  # another kind of frame
            frame = frame._replace(extended=bool(flags & 1), fd=bool(flags & 2), remote=bool(flags & 4))
        case 6:  # random data
            data = bytearray(noise[: len(data)])
        case 7:  # numbers that are none, or too large
            at = where % max(len(data) - 3, 1)
            data[at : at + 4] = SPECIAL[much % len(SPECIAL)][: len(data) - at]
        case 8:  # anything
            length = much % (65 if flags & 2 else 9)
            frame = Frame(where % 0x800, b"", bool(flags & 1), bool(flags & 2), bool(flags & 4))
            data = bytearray(noise[:length])
    return frame._replace(data=bytes(data))


@click.command()
@click.option("--frames", type=click.IntRange(min=1), default=1_000_000, show_default=True, help="Into each decoder.")
@common_options
def command(frames: int, out: Path, seed: int, jobs: int, quiet: bool, as_json: bool) -> None:
    """Send random and mutated frames into every motor's decoder and compare with independent oracles."""
    del out, jobs
    with progress("fuzz", total=frames * len(MOTORS), quiet=quiet) as advance:
        results = {name: fuzz(name, frames, seed, advance) for name in MOTORS}
    if as_json:
        print_json({name: {**found._asdict(), "example": repr(found.example)} for name, found in results.items()})
    else:
        columns = ("motor", "frames", "believed", "rejected", "accepted wrongly", "refused wrongly")
        print_table(columns, [(name, *found[:5]) for name, found in results.items()])
    if any(found.accepted_wrongly or found.refused_wrongly for found in results.values()):
        raise SystemExit(1)


if __name__ == "__main__":
    command()
