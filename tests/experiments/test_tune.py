"""Tuning: better on the training cases, resumes, and writes what controllers.make reads."""

import json

import pytest
from click.testing import CliRunner

import controllers
from controllers import tuning
from controllers.law import Factor
from experiments import tune
from experiments.bench_protocol import Protocol
from experiments.cli import main
from steer_env.errors import InputError
from steer_env.plants import PLANTS, Reference

REFERENCE = Reference.load("published")
GRIP = {"torque_gain": (0.5, 2.0), "inertia_share": (0.5, 2.0)}


def bowl(name, plant, causality, factors, reference, seed):
    """A made-up objective with its least value at known factors."""
    gain = factors.get("torque_gain", 1.0)
    return 1.0 + (gain - 1.5) * (gain - 1.5)


@pytest.fixture
def cheap(monkeypatch):
    tried = []
    monkeypatch.setattr(tune, "tunable", lambda name: GRIP)
    monkeypatch.setattr(tune, "objective", lambda *told: tried.append(told[3]) or bowl(*told))
    return tried


def test_it_finds_the_best_starts_at_the_design_and_leaves_idle_factors_out(cheap):
    """Catches a first trial that is not the design, and a file full of factors that do nothing."""
    found = tune.tune_loop("pid", "SbW", "impedance", REFERENCE, trials=40, seed=0)
    assert cheap[0] == dict.fromkeys(GRIP, 1.0)
    assert found["objective_before"] == pytest.approx(1.25)
    assert found["objective_after"] < 1.01
    assert list(found["factors"]) == ["torque_gain"]
    assert found["factors"]["torque_gain"] == pytest.approx(1.5, abs=0.1)
    assert found == tune.tune_loop("pid", "SbW", "impedance", REFERENCE, trials=40, seed=0)


def test_an_interrupted_run_goes_on(cheap, tmp_path):
    journal = tmp_path / "trials.log"
    tune.tune_loop("pid", "SbW", "impedance", REFERENCE, trials=6, seed=0, journal=journal)
    before = len(cheap)
    again = tune.tune_loop("pid", "SbW", "impedance", REFERENCE, trials=6, seed=0, journal=journal)
    assert again["trials"] == 6
    assert len(cheap) - before <= 1 + len(GRIP), "only the check for idle factors may run again"


def test_the_file_is_what_make_reads(cheap, tmp_path, monkeypatch):
    out = tmp_path / "tuned"
    arguments = ["tune", "pid", "--plant", "SbW", "--causality", "impedance", "--trials", "8", "--json"]
    done = CliRunner().invoke(main, [*arguments, "--out", str(out)])
    assert done.exit_code == 0, done.output
    content = json.loads((out / "pid.json").read_text())
    assert content["protocol"] == Protocol.load().name
    assert content["training"]["draw_seeds"] == Protocol.load().draw_seeds["training"]
    monkeypatch.setattr(tuning, "FOLDER", out)
    plain = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", tuned=False).parameters
    tuned = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance").parameters
    factor = content["loops"]["SbW-impedance"]["factors"]["torque_gain"]
    assert tuned.torque_gain == pytest.approx(factor * plain.torque_gain)
    own = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", torque_gain=0.7).parameters
    assert own.torque_gain == 0.7, "what is given by hand goes before what is shipped"
    assert tuning.gains_for("pid", "EPAS", "impedance") == {}


def test_the_objective_is_the_same_again_and_fears_what_is_unstable():
    """The real one: the same bits again, and a gain that throws the wheel costs more than any score."""
    told = ("pid", "SbW", "impedance")
    once = tune.objective(*told, {}, REFERENCE, 0)
    assert tune.objective(*told, {}, REFERENCE, 0) == once
    assert 0.0 < once < 3.0
    assert tune.objective(*told, {"acceleration_bandwidth": 9.0}, REFERENCE, 0) > Protocol.load().worst_score_jnd


def test_tuning_never_sees_a_test_plant(monkeypatch):
    seen = []
    monkeypatch.setattr(tune, "scored", lambda case, *_: seen.append(case) or {"case": {}, "stable": False})
    monkeypatch.setattr(tune, "case_score", lambda *_: 1.0)
    tune.objective("pid", "SbW", "impedance", {}, REFERENCE, 0)
    assert seen
    assert {case.split for case in seen} == {"training"}


def test_the_shipped_files_name_gains_that_exist_in_range():
    """Catches a file of gains that a renamed field or a narrower range has made useless."""
    for path in sorted(tuning.FOLDER.glob("*.json")):
        ranges = tune.tunable(path.stem)
        for loop in json.loads(path.read_text())["loops"].values():
            for gain, factor in loop["factors"].items():
                low, high = ranges[gain]
                assert 0.999 * low <= factor <= 1.001 * high, (path.name, gain)
        for plant in PLANTS.values():
            for causality in controllers.CAUSALITIES:
                controllers.make(path.stem, plant, REFERENCE, causality)


@pytest.mark.parametrize("text", ["", "{}", '{"schema_version": 99, "loops": {}}', '{"schema_version": 1, "loops": 3}'])
def test_a_broken_file_of_gains_is_named(tmp_path, text):
    path = tmp_path / "pid.json"
    path.write_text(text)
    with pytest.raises(InputError, match="steer-env tune"):
        tuning.gains_in(path, "EPAS", "impedance")


def test_a_wrong_name_ends_with_status_2(tmp_path):
    done = CliRunner().invoke(main, ["tune", "pdi", "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_a_factor_multiplies_and_a_number_replaces():
    made = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", tuned=False, torque_gain=Factor(0.5))
    plain = controllers.make("pid", PLANTS["SbW"], REFERENCE, "impedance", tuned=False)
    assert made.parameters.torque_gain == 0.5 * plain.parameters.torque_gain
