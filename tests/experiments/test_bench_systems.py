"""A benchmark ranks over the systems that all of its controllers are made for, and says which it leaves out."""

import json

import pytest
from click.testing import CliRunner

from controllers import policy_file
from experiments import benchmark
from experiments.bench_cases import Case
from experiments.bench_rig import RIG_SYSTEMS
from experiments.bench_systems import SYSTEMS, policies_of, ranked, reasons_of, system_of, task_of
from experiments.cli import main
from steer_env.errors import InputError
from tests.controllers.made_up_policy import made_up

SBW_IMPEDANCE = ("SbW", "impedance")


@pytest.fixture
def learned(tmp_path):
    """A function (plant, causality) that gives the name of a policy for them."""

    def saved(plant, causality):
        folder = tmp_path / f"{plant}-{causality}"
        policy_file.save(made_up(plant, causality), folder)
        return f"policy:{folder}"

    return saved


def test_what_all_are_made_for_is_ranked_and_the_rest_is_named(learned):
    """Catches a policy driven on a plant that it never saw, and a system that vanishes without a word."""
    assert ranked(["pid", "mine.py:Law"]) == (SYSTEMS, [])
    own = learned("SbW", "impedance")
    for name in (own, f"passivity:{own}"):
        systems, left_out = ranked(["pid", name])
        assert systems == (SBW_IMPEDANCE,)
        assert {(r["plant"], r["causality"]) for r in left_out} == set(SYSTEMS) - {SBW_IMPEDANCE}
        assert all(f"{name} is made for SbW impedance alone" in r["why"] for r in left_out)
        assert reasons_of(left_out).count("alone") == 1
    systems, _ = ranked(["policy"])
    assert {task_of(system).lower() for system in systems} == {name.lower() for name in policy_file.folders()}
    systems, left_out = ranked(["pid"], [SBW_IMPEDANCE])
    assert systems == (SBW_IMPEDANCE,)
    assert {r["why"] for r in left_out} == {"not asked for"}


def test_what_cannot_be_ranked_ends_with_its_reason(learned):
    here, there = learned("SbW", "impedance"), learned("EPAS", "admittance")
    with pytest.raises(InputError, match="no system that all"):
        ranked([here, there])
    with pytest.raises(InputError, match="no system that all"):
        ranked(["pid", there], there=RIG_SYSTEMS)
    with pytest.raises(InputError, match="made for SbW impedance alone, not for EPAS impedance"):
        ranked([here], [("EPAS", "impedance")])
    with pytest.raises(InputError, match="use one of EPAS-Impedance"):
        system_of("Lorry-Impedance")
    assert system_of("SbW-Impedance") == system_of("SbW-impedance") == SBW_IMPEDANCE


def test_the_command_scores_proves_and_reports_a_policy(tmp_path, monkeypatch, learned):
    """A made-up policy beside a law: same cases, a proof with its whole step, its own record, and its step's cost."""
    cases = [
        Case(*SBW_IMPEDANCE, name, 75.0, "step_steer", "relaxed", split="test", draw=k)
        for name in ("pid", name_of(learned))
        for k in (0, 1)
    ]
    monkeypatch.setattr(benchmark, "cases_of", lambda *_: cases)
    cost = {"p50_us": 1.0, "p999_us": 2.0}
    monkeypatch.setattr(benchmark, "reported", lambda names, *_: dict.fromkeys(names, cost))
    arguments = ["benchmark", "--quick", "--out", str(tmp_path / "out"), "--jobs", "1", "--only", "pid"]
    done = CliRunner().invoke(main, [*arguments, "--controller", name_of(learned)])
    assert done.exit_code == 0, done.output
    assert "Left out: EPAS impedance, EPAS admittance, SbW admittance" in done.stdout
    scores = json.loads((tmp_path / "out" / "scores.json").read_text())
    assert len(scores["left_out"]) == 3
    [record] = scores["policies"]
    assert (record["base"], record["step_ms"], record["plant"], record["least_share"]) == ("pid", 5.0, "SbW", 0.5)
    assert {gate["controller"] for gate in scores["gates"]} == {"pid", name_of(learned)}
    assert {(gate["plant"], gate["causality"]) for gate in scores["gates"]} == {SBW_IMPEDANCE}
    reached = [set(place["reached"]) for place in scores["limit"]]
    assert reached == [{"pid"}], "one point says little of a policy's error"
    page = (tmp_path / "out" / "report.html").read_text()
    assert "All controllers are ranked on SbW impedance. Left out: EPAS impedance" in page
    assert "is a small network that acts every 5 ms and corrects pid by up to 0.02 N m" in page
    assert "No linear proof" not in page
    assert "Policies are left out: the limit is that of a linear loop" in page


def name_of(learned):
    return learned("SbW", "impedance")


def test_a_system_that_is_asked_for_and_not_covered_ends_at_once(tmp_path, learned):
    """Exit status 2 before anything is driven or written."""
    arguments = ["benchmark", "--quick", "--out", str(tmp_path / "out"), "--controller", learned("SbW", "impedance")]
    for wrong, said in (("EPAS-Impedance", "leave that system"), ("Lorry", "not known")):
        done = CliRunner().invoke(main, [*arguments, "--system", wrong])
        assert done.exit_code == 2, done.output
        assert said in done.stderr
    done = CliRunner().invoke(main, ["benchmark", "--quick", "--controller", f"policy:{tmp_path / 'nowhere'}"])
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_what_a_policy_is_stands_beside_its_scores():
    """One record for each system; the shipped ones correct a law and say how they were trained."""
    records = policies_of(["pid", "policy"])
    assert len(records) == len(policy_file.folders())
    assert all(record["base"] and record["training_steps"] > 1e5 for record in records)
