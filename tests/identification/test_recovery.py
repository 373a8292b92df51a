"""The whole workflow against truths: the virtual test vehicle, standard errors over seeds, reference file, report."""

import json
import math
from dataclasses import replace
from functools import cache

import pytest
from click.testing import CliRunner

from experiments.cli import main
from experiments.coverage_study import known_virtual, overall, plans_virtual, study_conforming, virtual_campaign
from experiments.report.identify import write_identify_report
from identification.identify import Options, identify
from steer_env.plants.reference_file import read_reference, write_reference
from tests.identification import independent_campaign as made

SPEEDS_KMH = (45.0, 75.0, 105.0)
RELATIVE = {"C_f": 0.03, "C_r": 0.03, "n_t": 0.03, "J_z": 0.05, "J_ref": 0.05, "k_gain": 0.05, "c_pin_off": 0.10,
            "M_fric_C": 0.05}  # fmt: skip


@cache
def recovered():
    plans = plans_virtual(SPEEDS_KMH)
    campaign = virtual_campaign(plans, seed=1)
    return known_virtual(plans), campaign, identify(campaign, Options())


@pytest.mark.parametrize("mode", ["per-speed", "shared"])
def test_virtual_test_vehicle_is_recovered(mode):
    """A car that rolls, saturates, compensates and logs late: the targets of every parameter at 45 km/h and above."""
    known, _, result = recovered()
    for speed_kmh, found in zip(SPEEDS_KMH, result.modes[mode], strict=True):
        for name, tolerance in RELATIVE.items():
            assert found.values[name] == pytest.approx(known[speed_kmh][name], rel=tolerance), (speed_kmh, name)
        assert abs(found.values["b_ref"] - known[speed_kmh]["b_ref"]) < 0.05, speed_kmh


def test_standard_errors_hold_over_seeds():
    """Six seeds of a car that is the model: at least 85 % of the 95 % intervals hold, and none is bought with width."""
    lines = study_conforming(range(6), (60.0, 90.0))
    assert overall(lines) >= 0.85
    assert all(line.promised < 0.04 for line in lines if line.name != "sigma_r")


def test_reference_file_reads_back(tmp_path):
    """What is written is what environments load: errors, the paper's values and the slip form beside the rows."""
    _, _, result = recovered()
    path = tmp_path / "reference.json"
    write_reference(path, result.reference("per-speed"))
    read = read_reference(path)
    assert read.slip == "relaxed"
    assert [row.speed_kmh for row in read.rows] == list(SPEEDS_KMH)
    row = json.loads(path.read_text())["rows"][1]
    assert {"b_ref_Nms_per_rad_std", "b_ref_Nms_per_rad_frf", "C_f_N_per_rad_std"} <= set(row)
    assert row["extrapolated"] == []


def test_report_draws(tmp_path, assert_report_draws):
    """Every figure of the report is drawn by a browser without an error."""
    _, campaign, result = recovered()
    assert_report_draws(write_identify_report(campaign, result, tmp_path / "report.html"))


@pytest.mark.parametrize(
    ("gone", "step", "missing_key"),
    [
        (("rack_force_N",), "I-b1", "n_t"),
        (("torsion_bar_torque_Nm",), "II", "J_ref"),
        (("steering_torque_Nm",), "I-a2", "C_f"),
        (("pinion_angle_rad",), "I-a2", "C_f"),
        (("yaw_rate_radps", "lateral_acceleration_mps2", "sideslip_angle_rad"), "I-a2", "C_f"),
    ],
)
def test_missing_channel_skips_its_steps_and_writes_no_reference(gone, step, missing_key):
    """Nothing is invented: the step is named, the key has no value, and there is no reference to mislead anyone."""
    _, campaign = made.linear()
    result = identify(made.without(campaign, *gone), Options(("per-speed",)))
    for found in result.modes["per-speed"]:
        assert step in found.skipped
        assert missing_key in found.unidentified()
    assert result.reference("per-speed") is None
    assert missing_key in result.missing_keys("per-speed")


def test_one_speed_without_its_friction_is_extrapolated_and_listed():
    """A key that one speed does not tell comes from the line through its neighbours, and the file says so."""
    _, _, result = recovered()
    speeds = list(result.modes["per-speed"])
    poor = replace(speeds[0], std={n: e for n, e in speeds[0].std.items() if n != "M_fric_C"})
    reference = replace(result, modes={"per-speed": [poor, *speeds[1:]]}).reference("per-speed")
    a, b = speeds[1].values["M_fric_C"], speeds[2].values["M_fric_C"]
    assert reference.extrapolated[0] == ("M_fric_C",)
    assert reference.rows[0].M_fric_C == pytest.approx(a + (b - a) / 30.0 * (45.0 - 75.0))
    assert "M_fric_C" not in reference.std[0]


def test_command_end_to_end(tmp_path):
    """simulate, then identify: both references, the report, and the same numbers in --json."""
    runner = CliRunner()
    car, out = tmp_path / "car", tmp_path / "out"
    simulated = runner.invoke(main, ["simulate", "--speeds", "75", "--out", str(car), "--quiet"])
    assert simulated.exit_code == 0, simulated.output
    found = runner.invoke(main, ["identify", str(car), "--out", str(out), "--quiet", "--json"])
    assert found.exit_code == 0, found.output
    document = json.loads(found.stdout)
    values = document["modes"]["per-speed"][0]["values"]
    assert read_reference(out / "reference.json").rows[0].J_ref == values["J_ref_kgm2"]
    assert {p.name for p in out.iterdir()} == {"reference.json", "reference_shared.json", "report.html"}
    assert all(math.isfinite(v) for v in values.values())
