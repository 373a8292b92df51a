"""A real car's bus played back: unequal rates brought to one grid, counters and checksums verified."""

import csv
import gzip
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from steer_env.errors import InputError
from steer_env.rig.frame import Frame
from steer_env.rig.log_file import Logged
from steer_env.rig.replay import DbcDecoder, aligned, replay

RAV4 = Path(__file__).resolve().parents[3] / "shared" / "data" / "rav4_can" / "raw_can_subset.csv.gz"


def test_signals_of_unequal_rates_are_brought_to_one_grid():
    """A line at 83 Hz with jitter and a staircase at 50 Hz: the line is exact, the staircase holds its last value."""
    rng = np.random.default_rng(1)
    fast = np.sort(np.arange(200) / 83.0 + 0.002 * rng.random(200))
    slow = np.arange(120) / 50.0
    grid, out = aligned({"line": (fast, 3.0 * fast), "stairs": (slow, np.arange(120.0))}, 0.01, held=("stairs",))
    start = max(fast[0], slow[0])
    np.testing.assert_allclose(out["line"], 3.0 * (grid + start), atol=1e-9)
    assert set(np.diff(out["stairs"])) <= {0.0, 1.0}
    np.testing.assert_allclose(np.diff(grid), 0.01)
    with pytest.raises(InputError, match="overlap"):
        aligned({"a": (slow, slow), "b": (slow + 10.0, slow)}, 0.01)


def toyota_checksum(frame: Frame) -> bool:
    """Sum of the identifier's bytes, the length and all data but the last byte, which holds it."""
    data, identifier = frame.data, frame.identifier
    return (sum(data[:-1]) + len(data) + (identifier >> 8) + (identifier & 0xFF)) & 0xFF == data[-1]


@pytest.fixture
def rav4() -> list[Logged]:
    if not RAV4.is_file():
        pytest.skip("the real car's log is not here (../shared/data/rav4_can)")
    with gzip.open(RAV4, "rt") as file:
        rows = list(csv.DictReader(file))
    first = float(rows[0]["t_s"])
    return [
        Logged(float(r["t_s"]) - first, Frame(int(r["address_hex"], 16), bytes.fromhex(r["data_hex"])), False, r["src"])
        for r in rows
    ]


def rav4_decoder() -> DbcDecoder:
    checked = dict.fromkeys((0x24, 0x25, 0xB4, 0x260, 0x2E4), toyota_checksum)
    return DbcDecoder(Path(__file__).parent / "rav4.dbc", checked, {0x2E4: ("COUNTER", 64)})


def test_a_real_car_s_bus_plays_back(rav4):
    """60 s of five messages at 41 to 100 Hz with real jitter: every checksum and counter right, rates as known.

    The logger itself swapped four pairs of commands that it stamped with the same time: three wrong steps each.
    """
    found = replay(rav4, rav4_decoder())
    regular = found.regularity
    assert not any(entry.rejected for entry in regular.values())
    assert regular[0x2E4, False].counter_errors == 12
    commands = [logged for logged in rav4 if logged.frame.identifier == 0x2E4]
    steps = [(b.frame.data[0] - a.frame.data[0] >> 1) % 64 for a, b in pairwise(commands)]
    at_once = [a.time == b.time for a, b in pairwise(commands)]
    pairs = [k for k, step in enumerate(steps) if step == 63 and at_once[k]]
    assert len(pairs) == 4
    for k in pairs:
        commands[k], commands[k + 1] = commands[k + 1], commands[k]
    assert replay(commands, rav4_decoder()).regularity[0x2E4, False].counter_errors == 0
    rates = {identifier: len(entry.times) / 60.0 for (identifier, _), entry in regular.items()}
    assert rates[0x25] == pytest.approx(83.0, rel=0.03)
    assert rates[0x260] == pytest.approx(50.0, rel=0.03)
    assert rates[0x2E4] == pytest.approx(100.0, rel=0.03)
    assert 0.005 < regular[0x260, False].jitter[1] < 0.05
    angle = [found.signals[f"STEER_ANGLE_SENSOR.{name}"] for name in ("STEER_ANGLE", "STEER_FRACTION")]
    chosen = {
        "angle_deg": (angle[0][0], angle[0][1] + angle[1][1]),
        "driver": found.signals["STEER_TORQUE_SENSOR.STEER_TORQUE_DRIVER"],
        "speed_kmh": found.signals["SPEED.SPEED"],
        "yaw_degps": found.signals["KINEMATICS.YAW_RATE"],
    }
    grid, even = aligned(chosen, 0.02)
    assert grid[-1] == pytest.approx(60.0, abs=0.2)
    # A car turns where it is steered, about 0.1 s later: seen only if both signals stand on one time. The road is
    # nearly straight, so that the yaw rate's own step of 0.24 deg/s blurs it.
    asked, yaw = even["angle_deg"] * even["speed_kmh"], even["yaw_degps"]
    lags = range(0, 30)
    match = [np.corrcoef(yaw[lag:], asked[: asked.size - lag])[0, 1] for lag in lags]
    assert 0.04 <= 0.02 * int(np.argmax(match)) <= 0.2
    assert max(match) > 0.75


def test_a_damaged_real_frame_is_noticed(rav4):
    """One bit in every frame: a sum finds each; a frame left out: the counter finds it."""
    damaged = [
        logged._replace(frame=logged.frame._replace(data=bytes([logged.frame.data[0] ^ 0x02, *logged.frame.data[1:]])))
        for logged in rav4[:2000]
        if logged.frame.identifier in (0x25, 0x260)
    ]
    found = replay(damaged, rav4_decoder())
    assert all(sum(e.rejected.values()) == len(e.times) for e in found.regularity.values())
    commands = [logged for logged in rav4 if logged.frame.identifier == 0x2E4]
    del commands[100], commands[2000:2003]
    assert replay(commands, rav4_decoder()).regularity[0x2E4, False].counter_errors == 12 + 2
