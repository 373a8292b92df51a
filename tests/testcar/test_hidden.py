"""Effects in the virtual test car, and campaigns for blind tests that give nothing away."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from experiments.cli import main
from experiments.hidden_campaign import answer_path, hidden_campaign, parse_hidden, write_answer
from steer_env.errors import InputError
from steer_env.physics.effects import EFFECTS
from steer_env.physics.effects.vehicle_ports import effect_row
from steer_env.testcar.drive import drive, hidden_of
from steer_env.testcar.kernel import RECORD, machine_at, rollout
from steer_env.testcar.plan import PlannedRun, robot_target
from steer_env.testcar.variants import plain_car, random_car
from steer_env.units import from_kmh

VEHICLE = EFFECTS["vehicle"]
# Channel in which an effect must show in a clean log, and the least share of the channel's rms by which.
SHOWS = {
    "jacking_torque": ("rack_force_N", 0.005),
    "suspension_compliance": ("yaw_rate_radps", 0.005),
    "pneumatic_trail_drop": ("rack_force_N", 0.02),
    "road_crown": ("steering_torque_Nm", 0.01),
    "backlash": ("yaw_rate_radps", 0.002),
    "torsion_bar_nonlinearity": ("torsion_bar_torque_Nm", 0.0005),
    "universal_joint": ("torsion_bar_torque_Nm", 0.005),
    "variable_ratio": ("yaw_rate_radps", 0.002),
    "torque_ripple": ("torsion_bar_torque_Nm", 0.005),
    "stribeck_friction": ("torsion_bar_torque_Nm", 0.005),
    "column_friction": ("steering_torque_Nm", 0.01),
    "assist_deadzone": ("torsion_bar_torque_Nm", 0.01),
    "assist_saturation": ("torsion_bar_torque_Nm", 0.05),
    "latency_imu": ("yaw_rate_radps", 0.005),
    "latency_pinion": ("pinion_angle_rad", 0.005),
    "latency_torque": ("torsion_bar_torque_Nm", 0.005),
    "torque_gain": ("torsion_bar_torque_Nm", 0.02),
    "torque_offset": ("torsion_bar_torque_Nm", 0.01),
    "angle_offset": ("steering_angle_rad", 0.005),
    "yaw_gain": ("yaw_rate_radps", 0.02),
    "ay_gain": ("lateral_acceleration_mps2", 0.02),
}
CAR = plain_car()
RUN = PlannedRun(60.0, "steady_state", 1, 0.6)


def probe(name: str) -> dict[str, dict[str, float]]:
    effect = VEHICLE[name]
    strongest = 0 if name == "assist_saturation" else -1  # the lowest limit bites
    return {name: effect.at(effect.probes[strongest])._asdict()}


def test_a_row_of_absent_effects_is_the_plain_car() -> None:
    """Catches a port that is not zero at rest."""
    angle, rate = (part[:3000] for part in robot_target("steady_state", 0.6))
    quiet = np.zeros_like(angle)
    speed = from_kmh(60.0)
    plain = rollout(angle, rate, quiet, quiet, speed, machine_at(speed, CAR), None)
    absent = rollout(angle, rate, quiet, quiet, speed, machine_at(speed, CAR), effect_row({}))
    assert np.array_equal(absent, plain)


@pytest.mark.parametrize("name", sorted(SHOWS))
def test_each_effect_shows_where_the_catalogue_says(name: str) -> None:
    """Catches an effect that is listed but not connected."""
    channel, least = SHOWS[name]
    clean = drive(RUN, CAR, None)[channel]
    changed = drive(RUN, CAR, None, hidden_of(probe(name)))[channel]
    assert np.sqrt(np.mean((changed - clean) ** 2)) > least * np.sqrt(np.mean(clean**2))


def test_scrub_shows_at_walking_pace_only() -> None:
    """It fades with speed: the same campaign at 60 km/h does not know it."""
    hidden = hidden_of({"tyre_scrub": {"torque_Nm": 6.0, "fade_speed_mps": 2.0, "travel_rad": 0.1}})

    def change(speed_kmh: float) -> float:
        run = PlannedRun(speed_kmh, "steady_state", 1, 1.0)
        clean = drive(run, CAR, None)["rack_force_N"]
        return float(np.abs(drive(run, CAR, None, hidden)["rack_force_N"] - clean).max())

    assert change(10.0) > 100.0 * change(60.0) > 0.0


def test_column_friction_only_dissipates() -> None:
    """Its work over whole periods of a sine is positive: 4 times level times amplitude per period."""
    angle, rate = robot_target("steady_state", 0.6)
    quiet = np.zeros_like(angle)
    speed = from_kmh(60.0)
    work = []
    for row in (effect_row({}), effect_row({"column_friction": {"torque_Nm": 0.3}})):
        record = rollout(angle, rate, quiet, quiet, speed, machine_at(speed, CAR), row)[-10000:]
        torque, turned = (record[:, RECORD.index(n)] for n in ("steering_torque", "steering_rate"))
        work.append(float(np.sum(torque * turned)) * 1e-3)
    assert work[1] - work[0] == pytest.approx(2 * 4 * 0.3 * 0.6, rel=0.08)


def test_the_folder_tells_nothing(tmp_path: Path) -> None:
    """Two different answers leave the same names, columns and campaign.toml; the answer lies outside."""
    content = []
    for name in ("backlash", "yaw_gain"):
        folder = tmp_path / f"{name}_out" / "campaign"
        (folder / "runs").mkdir(parents=True)
        hidden_campaign(folder, probe(name), CAR, 5, (60.0,), 1, ("steady_state",))
        write_answer(folder, probe(name), 5)
        files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        header = (folder / files[-1]).read_text().splitlines()[0]
        content.append((files, header, (folder / "campaign.toml").read_text()))
        answer = json.loads(answer_path(folder).read_text())
        assert answer["effects"][0]["name"] == name
        assert answer_path(folder).parent != folder
    assert content[0] == content[1]


def test_hide_is_parsed_and_refused() -> None:
    """Values, parameters and draws arrive; nonsense is an InputError that names the mend."""
    given = parse_hidden(["universal_joint=0.02:phase_rad=1.5", "none"], 0)
    assert given == {"universal_joint": {"amplitude_rad": 0.02, "phase_rad": 1.5}}
    assert parse_hidden(["random"], 3) == parse_hidden(["random"], 3)
    for text in ("nonsense", "backlash=wide", "backlash:depth=1", "backlash=5"):
        with pytest.raises(InputError, match="--hide"):
            parse_hidden([text], 0)


def test_a_folder_that_tells_its_truth_is_refused(tmp_path: Path) -> None:
    """The truth of an earlier campaign would lie beside the blind runs."""
    (tmp_path / "truth.json").write_text("{}")
    refused = CliRunner().invoke(main, ["simulate", "--hide", "none", "--out", str(tmp_path), "--quiet"])
    assert refused.exit_code == 2
    assert not answer_path(tmp_path).exists()


def test_random_cars_differ_and_repeat() -> None:
    """The same generator gives the same car, another one another."""
    one, same, other = (random_car(np.random.default_rng(s)) for s in (1, 1, 2))
    assert one == same != other
    assert one.vehicle.compliance_f == 0.0
    assert one.steering.M_s_fric == 0.0
