"""Episodes become campaigns: what is in the file is what happened, at any moment, on a rig as in simulation."""

import os
import signal
import subprocess
import sys
import tomllib

import gymnasium
import numpy as np
import pytest

import controllers
from identification.campaign import read_campaign
from identification.campaign_table import open_table
from identification.rig import RigFit
from steer_env.campaign_file import FLUSH, CampaignFile
from steer_env.campaign_mf4 import campaign_as_mf4
from steer_env.envs import RecordCampaign
from steer_env.envs.record_campaign import EvenRows
from steer_env.errors import InputError
from steer_env.plants import PLANTS, Plant
from steer_env.rig.campaign import write_campaign
from steer_env.rig.log_file import read_log
from steer_env.rig.mf4 import write_frames
from steer_env.rig.motors import make
from steer_env.rig.recorder import Recorder


def drive(env, episodes=1, steps=None, law=None, **options):
    """Run episodes of a PID, or of a law of the time in s; the infos of the last one."""
    inside = env.unwrapped
    controller = controllers.make("pid", inside.plant, inside.reference, inside.task.causality)
    for k in range(episodes):
        _, info = env.reset(seed=k, options=options or None)
        controller.reset(1e-3)
        infos = [info]
        while not info["ended"] and len(infos) != steps:
            torque = law(info["time"]) if law else controller(info["observation"])
            *_, info = env.step(inside.action_for(torque))
            infos.append(info)
    return infos


def test_a_row_is_the_state_at_a_time_and_the_command_from_then_on(tmp_path):
    """Catches a shift by a period between motion and command, which is an inertia's phase at 10 Hz."""
    env = RecordCampaign(gymnasium.make("steer_env/SbW-Impedance-v0", duration=6.0), tmp_path, kind="rig")
    infos = drive(env)
    env.close()
    (run,) = read_campaign(tmp_path).runs
    assert run.dt == pytest.approx(1e-3)
    for column, values in {
        "motor_angle_rad": [info["pinion_angle"] for info in infos[:-1]],
        "sensor_torque_Nm": [-info["torsion_bar_torque"] for info in infos[:-1]],
        "motor_torque_Nm": [info["command"] for info in infos[1:]],
    }.items():
        np.testing.assert_allclose(run.channels[column], values, rtol=1e-8, atol=1e-12)


def test_a_campaign_of_kind_vehicle_has_the_balance_of_the_car(tmp_path):
    """m a_y and the rack's power: a wrong unit or ratio in a column breaks one of them."""
    env = RecordCampaign(gymnasium.make("steer_env/EPAS-Impedance-v0"), tmp_path)
    infos = drive(env)
    env.close()
    campaign = read_campaign(tmp_path)
    assert campaign.kind == "vehicle"
    assert campaign.vehicle == env.unwrapped.reference.file.vehicle
    (run,) = campaign.runs
    assert (run.manoeuvre, run.speed_kmh) == ("frequency_response", 75.0)
    force = run.channels["rack_force_N"]
    travel = np.diff(run.channels["pinion_angle_rad"]) / campaign.vehicle.pinion_ratio
    torque = np.array([info["rack_torque"] for info in infos[:-1]])
    work = np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(run.channels["pinion_angle_rad"]))
    assert np.sum(0.5 * (force[1:] + force[:-1]) * travel) == pytest.approx(work, rel=1e-6)
    assert abs(force).max() > 500.0


def test_the_rig_finds_its_parameters_through_the_whole_can_path(tmp_path):
    """Known plant, swept torque, stepped bus: campaign and log of the same run both give J and friction back."""
    plant = PLANTS["SbW"]
    s = plant.steering
    with Recorder(tmp_path) as recorder:
        rig = gymnasium.make(
            "steer_env/Rig-Impedance-v0", motor="senso_wheel", tap=recorder.frame, manoeuvre="standstill",
            driver="hands_off", duration=16.0,
        )  # fmt: skip
        env = RecordCampaign(rig, tmp_path, manoeuvre="torque_sweep")
        drive(env, law=lambda t: 1.2 * np.sin(2.0 * t + 1.5 * t * t))
        env.close()
    write_campaign(tmp_path / "of_log", read_log(tmp_path / "rig.blf"), make("senso_wheel"), "log", "torque_sweep")
    for folder in (tmp_path, tmp_path / "of_log"):
        campaign = read_campaign(folder)
        assert set(campaign.runs[0].channels) <= {"motor_angle_rad", "motor_torque_Nm", "motor_velocity_radps"}
        found = RigFit().fit(campaign).params_
        assert found["inertia_kgm2"] == pytest.approx(s.J_s + s.J_pin, rel=0.02)
        assert found["friction_level_Nm"] == pytest.approx(s.M_fric + s.M_s_fric, rel=0.1)
        assert found["damping_Nms_per_rad"] == pytest.approx(s.b_s + s.b_pin, rel=0.1)
        assert abs(found["delay_s"]) < 1e-3  # 0.5 ms of motor lag, less what lies between command and sample in a log


def test_a_torque_sensor_is_recorded_where_there_is_one(tmp_path):
    """The estimated torque of the other drives is made of the motion: as a channel it would be believed."""
    for motor, there in (("simulated", True), ("odrive_05", False)):
        rig = gymnasium.make(
            "steer_env/Rig-Impedance-v0", motor=motor, duration=0.3,
            motor_options={} if motor == "simulated" else {"rated_torque": 7.5},
        )  # fmt: skip
        env = RecordCampaign(rig, tmp_path / motor)
        drive(env)
        env.close()
        (file,) = (tmp_path / motor / "runs").iterdir()
        assert ("sensor_torque_Nm" in open_table(file).header) == there


def test_a_wheel_without_a_rack_gets_no_column_of_its_force(tmp_path):
    """Steer-by-wire: a column of zeros would be taken for a car without a steering trail."""
    env = RecordCampaign(gymnasium.make("steer_env/SbW-Impedance-v0", duration=0.1), tmp_path, kind="vehicle")
    drive(env)
    env.close()
    (file,) = (tmp_path / "runs").iterdir()
    header = open_table(file).header
    assert "rack_force_N" not in header
    assert "yaw_rate_radps" in header


KILLED = """
import sys
import gymnasium, steer_env
import numpy as np
from steer_env.envs import RecordCampaign
env = RecordCampaign(gymnasium.make("steer_env/SbW-Impedance-v0"), sys.argv[1], kind="rig")
env.reset(seed=0)
k = 0
while True:
    env.step(np.zeros(1, np.float32))
    k += 1
    print(k, flush=True)
"""


def test_a_kill_loses_a_tenth_of_a_second(tmp_path):
    """kill -9 in the middle of a run: the campaign reads at once, whole but for the rows not yet written."""
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    last = 0
    while last < 5500:
        last = int(process.stdout.readline())
    os.kill(process.pid, signal.SIGKILL)
    rest = process.communicate()[0].split()
    last = int(rest[-1]) if rest else last
    (run,) = read_campaign(tmp_path).runs
    assert run.manoeuvre == "free"  # five of the ten seconds that its manoeuvre needs
    assert last - run.time.size <= FLUSH + 1


def test_a_run_is_listed_as_what_it_is_long_enough_for(tmp_path):
    with CampaignFile(tmp_path, "x", "rig") as campaign:
        for seconds in (1.0, 6.0, 11.0):
            campaign.begin(("time_s", "motor_angle_rad", "motor_torque_Nm"), "steady_state")
            for t in np.arange(0.0, seconds, 0.01):
                campaign.row((t, np.sin(t), np.cos(t)))
    assert [(run.file, run.manoeuvre) for run in campaign.listed] == [
        ("runs/steady_state_2.csv", "free"), ("runs/steady_state_3.csv", "steady_state"),
    ]  # fmt: skip
    assert campaign.too_short == ["runs/steady_state_1.csv"]
    assert [run.manoeuvre for run in read_campaign(tmp_path).runs] == ["free", "steady_state"]
    with pytest.raises(InputError, match="already"):
        CampaignFile(tmp_path, "x", "rig")


def test_uneven_measurements_come_to_an_even_grid():
    """Straight lines stay straight lines; a command holds; the same measurement twice is one."""
    grid = EvenRows(1.0, held=[1])
    rows = []
    for time, command in ((10.0, 5.0), (10.7, 6.0), (12.5, 7.0), (12.5, 8.0), (14.0, 9.0)):
        rows += grid.feed(time, [2.0 * time, command])
    assert [row[0] for row in rows] == [0.0, 1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose([row[1] for row in rows], [20.0, 22.0, 24.0, 26.0, 28.0])
    assert [row[2] for row in rows] == [5.0, 6.0, 6.0, 8.0, 9.0]


def test_a_gap_in_the_measurements_begins_a_new_run(tmp_path):
    """A campaign's run has no hole; the environment here is a rig whose clock jumps once."""

    class Jumping(gymnasium.Wrapper):
        steps = 0

        def step(self, action):
            *rest, info = self.env.step(action)
            self.steps += 1
            if self.steps > 700:
                info["rig"]["arrival_time"] += 1.0
            return *rest, info

    rig = gymnasium.make("steer_env/Rig-Impedance-v0", motor="senso_wheel", duration=0.9)
    env = RecordCampaign(Jumping(rig), tmp_path)
    drive(env)
    env.close()
    lengths = [len(path.read_text().splitlines()) - 1 for path in sorted((tmp_path / "runs").iterdir())]
    assert lengths == pytest.approx([700, 700], abs=2)


@pytest.mark.parametrize(
    ("env", "options", "complaint"),
    [
        ("steer_env/EPAS-Impedance-v0", {"kind": "rig"}, "no motor on a bench"),
        ("steer_env/SbW-Impedance-v0", {"kind": "car"}, "no kind"),
    ],
)
def test_what_cannot_be_recorded_is_said(env, options, complaint, tmp_path):
    with pytest.raises(InputError, match=complaint):
        RecordCampaign(gymnasium.make(env), tmp_path, **options).reset(seed=0)
    moving = RecordCampaign(gymnasium.make("steer_env/SbW-Impedance-v0", speed_kmh=(60, 90)), tmp_path)
    with pytest.raises(InputError, match="speed changes"):
        moving.reset(seed=0)


def test_mf4_holds_the_same_campaign(tmp_path):
    """Same names, values and times as the CSV, and units in the file; a float of CSV has nine digits."""
    asammdf = pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    env = RecordCampaign(gymnasium.make("steer_env/EPAS-Impedance-v0", duration=11.0), tmp_path / "csv")
    drive(env)
    env.close()
    (path,) = campaign_as_mf4(tmp_path / "csv", tmp_path / "mf4")
    was, now = read_campaign(tmp_path / "csv"), read_campaign(tmp_path / "mf4")
    assert (now.kind, now.vehicle, now.steering) == (was.kind, was.vehicle, was.steering)
    assert now.runs[0].channels.keys() == was.runs[0].channels.keys()
    np.testing.assert_allclose(now.runs[0].time, was.runs[0].time, atol=1e-9)
    for name, values in was.runs[0].channels.items():
        np.testing.assert_array_equal(now.runs[0].channels[name], values)
    with asammdf.MDF(path) as mdf:
        assert mdf.get("yaw_rate_radps").unit == "rad/s"
        assert mdf.get("rack_force_N").unit == "N"
    assert tomllib.loads((tmp_path / "mf4/campaign.toml").read_text())["runs"][0]["file"].endswith(".mf4")


@pytest.mark.parametrize(("motor", "options"), [("senso_wheel", {}), ("moteus", {"rated_torque": 7.5})])
def test_mf4_holds_the_same_frames(motor, options, tmp_path):
    """Read back by python-can, which knows nothing of our writer: identifiers, data, direction, time to 1 us."""
    pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    with Recorder(tmp_path) as recorder:
        tap = recorder.frame
        env = gymnasium.make("steer_env/Rig-Impedance-v0", motor=motor, motor_options=options, tap=tap, duration=0.2)
        drive(env)
        env.close()
    log = read_log(tmp_path / "rig.blf")
    write_frames(tmp_path / "rig.mf4", log)
    again = read_log(tmp_path / "rig.mf4")
    assert [logged.frame for logged in again.frames] == [logged.frame for logged in log.frames]
    assert [logged.sent for logged in again.frames] == [logged.sent for logged in log.frames]
    np.testing.assert_allclose([f.time for f in again.frames], [f.time for f in log.frames], atol=1e-6)
    assert again.start == pytest.approx(log.start, abs=1e-3)


def test_tools_decode_the_frames_of_an_mf4(tmp_path):
    """asammdf's own bus logging, given the motor's DBC, finds the angle that our decoder finds."""
    asammdf = pytest.importorskip("asammdf", reason="the extra [formats] is not installed")
    from steer_env.rig.motors.dbc import FOLDER
    from steer_env.rig.replay import MotorDecoder, replay

    with Recorder(tmp_path) as recorder:
        env = gymnasium.make("steer_env/Rig-Impedance-v0", motor="simulated", tap=recorder.frame, duration=0.5)
        drive(env)
        env.close()
    log = read_log(tmp_path / "rig.blf")
    write_frames(tmp_path / "rig.mf4", log, FOLDER / "simulated.dbc")
    with asammdf.MDF(tmp_path / "rig.mf4") as mdf:
        decoded = mdf.extract_bus_logging(database_files={"CAN": [(FOLDER / "simulated.dbc", 0)]})
        angle = decoded.get("Angle")
    expected = replay(log.frames, MotorDecoder(make("simulated"))).signals["angle_rad"][1]
    np.testing.assert_allclose(angle.samples, expected, atol=1e-9)


def test_without_asammdf_one_message_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(InputError, match="formats"):
        campaign_as_mf4(tmp_path, tmp_path / "mf4")


def test_a_plant_is_what_the_rows_of_the_table_say():
    """The table [steering] is the plant's, so that identify takes the right wheel off."""
    from steer_env.envs.record_campaign import steering_keys

    plant: Plant = PLANTS["EPAS"]
    assert steering_keys(plant)["wheel_inertia_kgm2"] == plant.steering.J_s
    assert steering_keys(plant)["torsion_bar_stiffness_Nm_per_rad"] == plant.steering.c_tb
