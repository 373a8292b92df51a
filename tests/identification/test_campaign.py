"""Good campaigns in every dress the contract allows give the same runs in SI."""

import hashlib
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from identification.campaign import read_campaign
from steer_env.errors import InputError
from tests.identification.synthetic_campaign import (
    vehicle_run,
    write_csv,
    write_rig_campaign,
    write_vehicle_campaign,
)

FIRST = "runs/060_frequency_response_1.csv"


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_vehicle_campaign(tmp_path_factory.mktemp("valid"))


@pytest.fixture
def folder(valid: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(valid, tmp_path / "campaign"))


def _add(folder: Path, text: str) -> None:
    path = folder / "campaign.toml"
    content = path.read_text("utf-8").replace("\n[[runs]]", f"\n{text}\n\n[[runs]]", 1)
    path.write_text(content, encoding="utf-8")


def _rename(folder: Path, old: str, new: str) -> None:
    path = folder / "campaign.toml"
    path.write_text(path.read_text("utf-8").replace(old, new), encoding="utf-8")


def _same(folder: Path, channels: dict[str, np.ndarray], tolerance: float = 1e-7) -> None:
    """The first run holds these channels, to a share of each one's size."""
    run = read_campaign(folder).runs[0]
    assert set(run.channels) == set(channels) - {"time_s"}
    np.testing.assert_allclose(run.time, channels["time_s"], atol=1e-6)
    for name, values in run.channels.items():
        size = np.max(np.abs(channels[name]))
        np.testing.assert_allclose(values, channels[name], atol=tolerance * size, err_msg=name)


def test_values_roles_hashes_and_known_parameters(folder: Path) -> None:
    """Catches a mixed-up column, a lost repeat, a hash of something else, a swapped parameter."""
    campaign = read_campaign(folder / "campaign.toml")
    _same(folder, vehicle_run(60.0, phase=0.2))
    assert [run.role for run in campaign.runs] == ["identify", "identify", "validate", "identify"]
    assert [run.speed_kmh for run in campaign.runs] == [60.0, 60.0, 60.0, 90.0]
    assert campaign.hashes[FIRST] == hashlib.sha256((folder / FIRST).read_bytes()).hexdigest()
    assert set(campaign.hashes) == {"campaign.toml", *(run.name for run in campaign.runs)}
    assert campaign.vehicle is not None
    assert campaign.steering is not None
    assert (campaign.vehicle.cg_to_front_axle, campaign.vehicle.pinion_ratio) == (1.24, 118.0)
    assert (campaign.steering.torsion_bar_stiffness, campaign.steering.robot_inertia) == (115, 0.03)
    assert list(campaign.select("frequency_response")) == [60.0, 90.0]
    assert len(campaign.select("frequency_response", "validate")[60.0]) == 1


def test_a_stated_role_is_kept_and_switches_the_automatic_one_off(folder: Path) -> None:
    """Catches a reader that holds out one run more than the user asked for."""
    _rename(folder, 'speed_kmh = 60.0\nrole = "auto"', 'speed_kmh = 60.0\nrole = "validate"')
    _rename(folder, 'speed_kmh = 60.0\nrole = "validate"', 'speed_kmh = 60.0\nrole = "auto"')
    text = (folder / "campaign.toml").read_text("utf-8").replace('"auto"', '"validate"', 1)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    roles = [run.role for run in read_campaign(folder).runs]
    assert roles == ["validate", "identify", "identify", "identify"]


def test_users_names_and_units_are_converted(folder: Path) -> None:
    """Catches a wrong factor, and scale, offset and unit applied in the wrong order."""
    truth = vehicle_run(60.0, phase=0.2)
    stored = {
        "stamp": truth["time_s"] * 1e9 + 1.479e18,
        "SteerAng": np.degrees(truth["steering_angle_rad"]) * 10.0 + 5.0,
        "HandTq": truth["steering_torque_Nm"] * 1e3,
        "PinAng": np.degrees(truth["pinion_angle_rad"]),
        "EPS_TorsBarTq": -truth["torsion_bar_torque_Nm"],
        "Rack": truth["rack_force_N"] / 1e3,
        "Speed": truth["vehicle_speed_mps"] * 3.6,
        "LatSpeed": truth["lateral_speed_mps"] * 3.6,
        "Yaw": np.degrees(truth["yaw_rate_radps"]),
        "AccY": truth["lateral_acceleration_mps2"] / 9.80665,
        "Beta": truth["sideslip_angle_rad"] * 1e3,
        "comment": truth["time_s"] * 0.0,
    }
    with (folder / FIRST).open("w", encoding="utf-8") as file:
        file.write(",".join(stored) + "\n")
        np.savetxt(file, np.column_stack(list(stored.values())), delimiter=",", fmt="%.17g")
    (folder / "campaign.toml").write_text(
        (folder / "campaign.toml")
        .read_text("utf-8")
        .rpartition("\n[[runs]]\nfile")[0]
        .replace(
            "\n[[runs]]",
            """
[channels]
time_s = { source = "stamp", unit = "ns", offset = "first" }
steering_angle_rad = { source = "SteerAng", unit = "deg", scale = 0.1, offset = -0.5 }
steering_torque_Nm = { source = "HandTq", unit = "mNm" }
pinion_angle_rad = { source = "PinAng", unit = "deg" }
torsion_bar_torque_Nm = { source = "EPS_TorsBarTq", unit = "N*m", scale = -1.0 }
rack_force_N = { source = "Rack", unit = "kN" }
vehicle_speed_mps = { source = "Speed", unit = "km/h" }
lateral_speed_mps = { source = "LatSpeed", unit = "kph" }
yaw_rate_radps = { source = "Yaw", unit = "deg/s" }
lateral_acceleration_mps2 = { source = "AccY", unit = "g" }
sideslip_angle_rad = { source = "Beta", unit = "mrad" }

[[runs]]""",
            1,
        )
        .partition('\n[[runs]]\nfile = "runs/060_frequency_response_2')[0],
        encoding="utf-8",
    )
    _same(folder, truth, tolerance=1e-6)


def test_jitter_below_a_fifth_of_the_step_is_resampled_and_noted(folder: Path) -> None:
    """Catches samples moved to the wrong instant: 3 ms would be 0.09 rad of phase at 5 Hz."""
    exact = vehicle_run(60.0, phase=0.2)
    shift = np.random.default_rng(3).uniform(-0.0019, 0.0019, len(exact["time_s"]))
    shift[[0, -1]] = 0.0
    time = exact["time_s"] + shift
    jittered = {n: np.interp(time, exact["time_s"], v) for n, v in exact.items()}
    sweep = 0.2 * time + 0.5 * (4.8 / 17.5) * time * time
    jittered["pinion_angle_rad"] = 0.4 * np.sin(2 * np.pi * sweep + 0.2)
    write_csv(folder / FIRST, {**jittered, "time_s": time})
    run = read_campaign(folder).runs[0]
    assert "jitters by up to" in run.notes[0]
    np.testing.assert_allclose(run.time, exact["time_s"], atol=1e-9)
    # 5 Hz at 50 Hz sampling is coarse: the first half of the sweep is below 2.6 Hz.
    half = slice(0, len(time) // 2)
    np.testing.assert_allclose(
        run.channels["pinion_angle_rad"][half], exact["pinion_angle_rad"][half], atol=4e-4
    )


def test_even_time_is_not_touched(folder: Path) -> None:
    """Catches resampling of data that needs none: the values must be those of the file."""
    stored = np.genfromtxt(folder / FIRST, delimiter=",", names=True)
    run = read_campaign(folder).runs[0]
    assert run.notes == []
    assert np.array_equal(run.channels["yaw_rate_radps"], stored["yaw_rate_radps"])


@pytest.mark.parametrize("dress", ["quotes", "crlf", "bom", "no newline at the end"])
def test_csv_as_other_programs_write_it(dress: str, folder: Path) -> None:
    """Catches a first column named with a byte-order mark, quotes, or line ends of Windows."""
    content = (folder / FIRST).read_bytes()
    header, _, body = content.partition(b"\n")
    content = {
        "quotes": b",".join(b'"' + name + b'"' for name in header.split(b",")) + b"\n" + body,
        "crlf": content.replace(b"\n", b"\r\n"),
        "bom": b"\xef\xbb\xbf" + content,
        "no newline at the end": content.rstrip(b"\n"),
    }[dress]
    (folder / FIRST).write_bytes(content)
    _same(folder, vehicle_run(60.0, phase=0.2))


def test_parquet_run(folder: Path) -> None:
    """Catches columns mixed up by a reader of another format."""
    pyarrow = pytest.importorskip("pyarrow", reason="the extra [formats] is not installed")
    from pyarrow import parquet

    channels = vehicle_run(60.0, phase=0.2)
    parquet.write_table(pyarrow.table(channels), folder / "runs/first.parquet")
    _rename(folder, FIRST, "runs/first.parquet")
    _same(folder, channels)


def test_mf4_run_with_its_own_time(folder: Path) -> None:
    """Catches a lost master channel: an MF4 file needs no column time_s."""
    asammdf = pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    channels = vehicle_run(60.0, phase=0.2)
    time = channels["time_s"]
    with asammdf.MDF(version="4.10") as mdf:
        signals = [
            asammdf.Signal(samples=values, timestamps=time, name=name)
            for name, values in channels.items()
            if name != "time_s"
        ]
        mdf.append(signals)
        mdf.save(folder / "runs/first.mf4")
    _rename(folder, FIRST, "runs/first.mf4")
    _same(folder, channels)


def test_missing_extra_says_how_to_install_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a bare ImportError where the optional reader is absent."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    (folder / "runs/first.parquet").write_bytes(b"PAR1")
    _rename(folder, FIRST, "runs/first.parquet")
    with pytest.raises(InputError, match=r"pip install 'steer-env\[formats\]'"):
        read_campaign(folder)


def test_rig_campaign(tmp_path: Path) -> None:
    """Catches a rig being asked for a car's channels, and a lost start value."""
    campaign = read_campaign(write_rig_campaign(tmp_path))
    assert campaign.vehicle is None
    assert campaign.rig is not None
    assert campaign.rig.inertia == 0.02
    assert campaign.rig.damping is None
    assert set(campaign.runs[0].channels) == {"motor_angle_rad", "motor_torque_Nm"}
    assert campaign.runs[0].dt == pytest.approx(0.002)


def test_a_channel_may_be_absent_from_some_runs(folder: Path) -> None:
    """The map is checked against the campaign, not against each run: 90 km/h has no rack force."""
    _add(folder, '[channels]\nrack_force_N = { source = "rack_force_N", unit = "N" }')
    channels = vehicle_run(90.0)
    del channels["rack_force_N"]
    write_csv(folder / "runs/090_frequency_response_1.csv", channels)
    assert "rack_force_N" not in read_campaign(folder).runs[3].channels
