"""The gap workflow on campaigns in which something is hidden: vehicle, rig and drive."""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from click.testing import CliRunner

from experiments.cli import main
from experiments.hidden_campaign import hidden_campaign
from identification.campaign import read_campaign
from identification.gap.workflow import find_gap
from steer_env.errors import InputError
from steer_env.plants.model_file import read_model
from steer_env.testcar.bench import LOADED, Bench, Command, bench_campaign, bench_rollout
from steer_env.testcar.variants import plain_car
from tests.identification.synthetic_drive import LEVEL, drive, write_drive_campaign

MKZ = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "mkz_drive"
GAP_KEYS = {"schema_version", "verdict", "effects", "gap", "symptoms", "ranking", "ambiguous_with", "next_measurement"}


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plain car with a universal joint hidden in it, and what the command makes of its campaign."""
    folder = tmp_path_factory.mktemp("gap") / "campaign"
    (folder / "runs").mkdir(parents=True)
    present = {"universal_joint": {"amplitude_rad": 0.012, "phase_rad": 1.0}}
    hidden_campaign(folder, present, plain_car(), 3, (40.0, 80.0), 3, ("frequency_response", "steady_state"), jobs=2)
    done = CliRunner().invoke(main, ["gap", str(folder), "--out", str(folder.parent / "out"), "--quiet", "--jobs", "1"])
    assert done.exit_code == 0, done.output
    assert "universal_joint" in done.output
    return folder.parent / "out"


def test_gap_json_is_the_contract(driven: Path) -> None:
    """Keys to the letter; the joint is named with its size inside the interval, and the gap shrinks."""
    document = json.loads((driven / "gap.json").read_text())
    assert set(document) >= GAP_KEYS
    assert document["verdict"] == "effect"
    assert [e["name"] for e in document["effects"]] == ["universal_joint"]
    found = document["effects"][0]["parameters"]["amplitude_rad"]
    assert found["value"] == pytest.approx(0.012, rel=0.03)
    assert found["ci95"][0] < found["value"] < found["ci95"][1]
    assert 0.5 < document["effects"][0]["probability"] <= 1.0
    gap = document["gap"]
    assert gap["noise_floor"] < gap["after"] < gap["before"]
    shrunk = {name: channel["after"] / channel["before"] for name, channel in gap["channels"].items()}
    assert min(shrunk.values()) < 0.5  # where the joint shows, most of the error is gone
    assert set(gap["channels"]["yaw_rate_radps"]) == {"before", "after", "noise_floor"}
    assert document["symptoms"]
    assert {"what", "where", "strength"} == set(document["symptoms"][0])
    assert {"name", "delta_bic", "gap_after"} <= set(document["ranking"][0])
    advice = document["next_measurement"]
    assert advice is None or {"manoeuvre", "speed_kmh", "why"} == set(advice)


def test_model_json_loads_into_an_environment(driven: Path) -> None:
    """The environment with the model turns otherwise than without, and the vector environment like the single one."""
    model = read_model(driven / "model.json")
    assert set(model.effects) == {"universal_joint"}
    assert len(model.reference.rows) == 2
    path = str(driven / "model.json")
    torque = []
    for effects in (model, type(model)(model.reference, {}, {})):
        env = gymnasium.make("steer_env/EPAS-Impedance-v0", model=effects, speed_kmh=60.0)
        env.reset(seed=1)
        for _ in range(800):
            *_, info = env.step(np.array([0.1], np.float32))
        torque.append(info["torsion_bar_torque"])
    assert abs(torque[0] - torque[1]) > 0.01
    many = gymnasium.make_vec(
        "steer_env/EPAS-Impedance-v0", num_envs=2, vectorization_mode="vector_entry_point", model=path, speed_kmh=60.0
    )
    many.reset(seed=1)
    for _ in range(800):
        *_, infos = many.step(np.full((2, 1), 0.1, np.float32))
    assert infos["torsion_bar_torque"][0] == torque[0]


def test_report_draws(driven: Path, assert_report_draws) -> None:
    """Every figure of the page is drawn."""
    assert_report_draws(driven / "report.html")


def test_nothing_hidden_nothing_named(tmp_path: Path) -> None:
    """The plain car is richer than the nominal model: its honest errors must not get a name."""
    folder = tmp_path / "campaign"
    (folder / "runs").mkdir(parents=True)
    hidden_campaign(folder, {}, plain_car(), 4, (40.0, 80.0), 3, ("frequency_response", "steady_state"), jobs=2)
    result = find_gap(read_campaign(folder))
    assert (result.verdict, result.effects) == ("none", ())


def test_bad_models_are_refused(driven: Path, tmp_path: Path) -> None:
    """One message that names file and key."""
    table = json.loads((driven / "model.json").read_text())
    for change, key in (
        ({"effects": [{"name": "ghost", "parameters": {}}]}, "name"),
        ({"effects": {}}, "effects"),
        ({"kind": "rig"}, "kind"),
    ):
        path = tmp_path / "model.json"
        path.write_text(json.dumps({**table, **change}))
        with pytest.raises(InputError, match=key):
            read_model(path)


def test_bench_is_the_nominal_model_in_closed_form() -> None:
    """Constant torque on J and b: the rate goes to torque / b as 1 - exp(-b t / J), to the step's order."""
    n, J, b = 1000, 0.04, 0.4
    feed = np.full(n, 0.5)
    record = bench_rollout(feed, np.zeros(n), Command(stiffness=0.0, damping=0.0), Bench(J, b), None, None)
    t = 0.002 * np.arange(n)
    exact = 0.5 / b * (t - J / b * (1.0 - np.exp(-b * t / J)))
    np.testing.assert_allclose(record[:, 0], exact, atol=2e-3 * exact[-1])


@pytest.mark.parametrize(
    ("name", "values", "key"),
    [
        ("coulomb_friction", {"level_Nm": 0.3}, "level_Nm"),
        ("presliding_friction", {"level_Nm": 0.5, "travel_rad": 0.08}, "travel_rad"),
        ("stribeck_friction", {"extra_Nm": 0.4, "level_Nm": 0.3, "speed_radps": 0.3}, "extra_Nm"),
        ("asymmetric_friction", {"viscous_Nms_per_rad": 0.02}, "viscous_Nms_per_rad"),
        ("gravity_unbalance", {"sin_Nm": 0.4, "cos_Nm": 0.1}, "sin_Nm"),
        ("torque_ripple", {"amplitude_Nm": 0.08, "order": 14.0, "phase": 1.0}, "order"),
        ("command_latency", {"delay_s": 0.006}, "delay_s"),
        ("torque_offset", {"Nm": 0.08}, "Nm"),
        ("quadratic_drag", {"drag_Nms2_per_rad2": 0.006}, "drag_Nms2_per_rad2"),
        ("spring_centering", {"stiffness_Nm_per_rad": 2.0}, "stiffness_Nm_per_rad"),
        ("backlash", {"half_gap_rad": 0.008}, "half_gap_rad"),
    ],
)
def test_each_effect_of_a_bench_is_named(name: str, values: dict[str, float], key: str, tmp_path: Path) -> None:
    """A blind bench: the name is right and its size within a tenth."""
    bench_campaign(tmp_path / "rig", {name: values}, seed=2)
    result = find_gap(read_campaign(tmp_path / "rig"))
    assert result.verdict == "effect"
    assert [e.name for e in result.effects] == [name]
    assert result.effects[0].parameters[key].value == pytest.approx(values[key], rel=0.1)


def test_a_gain_is_told_from_a_spring_where_the_load_moves_on_its_own(tmp_path: Path) -> None:
    """Catches a second name that only undoes the first: a gain of 2.6 beside a spring, both undetermined."""
    bench_campaign(tmp_path / "rig", {"torque_gain": {"ratio": 1.08}}, seed=1, bench=LOADED)
    result = find_gap(read_campaign(tmp_path / "rig"))
    assert [e.name for e in result.effects] == ["torque_gain"]
    assert result.effects[0].parameters["ratio"].value == pytest.approx(1.08, abs=0.005)


def test_a_plain_bench_lacks_nothing(tmp_path: Path) -> None:
    """Friction and cogging far below what counts as an effect stay unnamed."""
    bench_campaign(tmp_path / "rig", {}, seed=5)
    assert find_gap(read_campaign(tmp_path / "rig")).verdict == "none"


def test_a_drive_shows_its_friction(tmp_path: Path) -> None:
    """An independent drive with Dahl friction of 0.4 N m and a bias that walks at random: both, and nothing else."""
    result = find_gap(read_campaign(write_drive_campaign(tmp_path / "drive", drive(1))))
    assert result.verdict == "effect"
    friction = [e for e in result.effects if e.name in ("coulomb_friction", "presliding_friction")]
    assert len(friction) == 1
    assert friction[0].parameters["level_Nm"].value == pytest.approx(LEVEL, rel=0.15)
    assert {e.name for e in result.effects} - {friction[0].name} <= {"torque_offset_drift"}


@pytest.mark.skipif(not MKZ.exists(), reason=f"the measured drive is not there ({MKZ})")
def test_the_measured_drive_shows_its_friction() -> None:
    """200 s of a real car: dry friction of about 0.3 N m is confirmed on the half that was not fitted."""
    result = find_gap(read_campaign(MKZ))
    assert result.verdict == "effect"
    assert result.effects[0].name == "coulomb_friction"
    assert 0.2 < result.effects[0].parameters["level_Nm"].value < 0.45
    assert result.channels["steering_torque_Nm"].after < 0.9 * result.channels["steering_torque_Nm"].before
