"""The data acquisition: latency, noise and resolution of each channel, and the clean log."""

import numpy as np
import pytest

from steer_env.testcar.kernel import PERIOD, RECORD
from steer_env.testcar.logger import CHANNELS, LOG_PERIOD, disturbances, log
from steer_env.testcar.parameters import Disturbance

N = 20000
I_RP = 118.0


def record_of(values: np.ndarray) -> np.ndarray:
    """A record whose every column is ``values``."""
    return np.repeat(values[:, None], len(RECORD), axis=1)


def test_clean_log_is_the_decimated_truth() -> None:
    """No filter, noise, latency or rounding hides in a clean log."""
    values = np.sin(np.arange(N) * 0.01)
    columns = log(record_of(values), 20.0, I_RP, None)
    assert np.array_equal(columns["yaw_rate_radps"], values[::10])
    assert np.array_equal(columns["rack_force_N"], I_RP * values[::10])
    assert np.array_equal(columns["sideslip_angle_rad"], np.arctan2(values[::10], 20.0))
    assert columns["time_s"] == pytest.approx(np.arange(N // 10) * LOG_PERIOD)


def test_each_channel_has_its_own_latency() -> None:
    """On a ramp, a channel that is late by tau reads lower by slope x tau than one that is not."""
    slope = 2.0
    columns = log(record_of(slope * np.arange(N) * PERIOD), 20.0, 1.0, np.random.default_rng(0))
    wired = columns["steering_angle_rad"]
    for channel in CHANNELS:
        if channel.column in ("vehicle_speed_mps", "sideslip_angle_rad"):
            continue  # not a copy of the ramp
        behind = np.mean((wired - columns[channel.column])[200:])
        own = 4.0 * max(channel.noise, channel.resolution) / np.sqrt(len(wired) - 200)
        assert behind == pytest.approx(slope * channel.latency, abs=own + 2e-5)


def test_each_channel_has_its_own_noise_and_resolution() -> None:
    """Standing still, only noise and rounding are left, of the stated size."""
    columns = log(record_of(np.zeros(10 * N)), 20.0, I_RP, np.random.default_rng(1))
    for channel in CHANNELS:
        values = columns[channel.column]
        steps = values / channel.resolution
        assert np.abs(steps - np.round(steps)).max() < 1e-6 * (1.0 + np.abs(steps).max())
        rms = np.hypot(channel.noise, channel.resolution / np.sqrt(12.0))
        if (
            channel.noise > 0.5 * channel.resolution
        ):  # rounding acts as noise only if noise reaches over the steps
            assert np.std(values) == pytest.approx(rms, rel=0.05)


def test_channels_are_independent() -> None:
    """Noise must not be shared between channels: the instrument method rests on that."""
    columns = log(record_of(np.zeros(10 * N)), 20.0, I_RP, np.random.default_rng(2))
    noisy = np.array([columns[c.column] for c in CHANNELS if c.noise > 0.5 * c.resolution])
    correlation = np.corrcoef(noisy) - np.eye(len(noisy))
    assert np.abs(correlation).max() < 5.0 / np.sqrt(noisy.shape[1])


def test_disturbance_has_the_stated_size_and_band() -> None:
    """Rms as stated; below the bandwidth flat, above it falling."""
    p = Disturbance()
    road, wind = disturbances(200000, p, np.random.default_rng(4))
    assert np.std(road) == pytest.approx(p.road_torque, rel=0.05)
    assert np.std(wind) == pytest.approx(p.side_force, rel=0.15)
    power = np.abs(np.fft.rfft(road)) ** 2
    frequency = np.fft.rfftfreq(len(road), PERIOD)
    low = power[(frequency > 0.5) & (frequency < 3.0)].mean()
    at_bandwidth = power[(frequency > 11.0) & (frequency < 13.0)].mean()
    assert at_bandwidth / low == pytest.approx(0.5, rel=0.2)


def test_without_generator_nothing_is_drawn() -> None:
    """A clean run has no road and no wind."""
    road, wind = disturbances(10, Disturbance(), None)
    assert not road.any()
    assert not wind.any()
