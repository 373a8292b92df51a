"""The benchmark: same bits whatever the order, resumes, takes a user's controller, says what its numbers say."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from controllers import CONTROLLERS
from experiments import bench_cases, bench_run, benchmark
from experiments.bench_cases import Case
from experiments.bench_protocol import Protocol
from experiments.bench_run import batches_of, run_cases
from experiments.bench_store import Store, key_of
from experiments.bench_verdict import verdicts
from experiments.cli import main
from steer_env.plants import PLANTS, Reference

CHIRP, SINE = bench_cases.MANOEUVRES
REFERENCE = Reference.load("published")
PAIR = [
    Case("SbW", "impedance", name, 75.0, manoeuvre, "relaxed", linear)
    for name in ("open_loop_map", "pid")
    for manoeuvre, linear in ((CHIRP, True), (CHIRP, False), (SINE, False))
]
SCORED = [
    Case("SbW", "impedance", name, 75.0, manoeuvre, "relaxed", split="test", draw=k)
    for name in ("open_loop_map", "pid")
    for manoeuvre in ("step_steer", "release")
    for k in (0, 1)
]


@pytest.fixture(scope="module")
def results():
    return run_cases(PAIR, REFERENCE, jobs=2)


def test_the_order_and_the_threads_do_not_matter(results):
    """Catches noise drawn from one stream over all cases, and a controller that remembers the case before."""
    backwards = run_cases(PAIR[::-1], REFERENCE, jobs=1)
    assert backwards[::-1] == results
    assert run_cases(PAIR[1:2], REFERENCE, seed=1) != results[1:2], "the seed must matter"


def test_pid_beats_the_map_and_stays_within_the_limits(results):
    """1.5 dB and 10 deg of the linear reference at 75 km/h, on one of the four systems; the benchmark has all."""
    found = {v.controller: v for v in verdicts(results)}
    assert found["pid"].factor > 2.0
    assert found["pid"].within is True
    assert found["open_loop_map"].within is False


def test_an_interrupted_run_keeps_what_it_had_and_resumes(tmp_path, monkeypatch, results):
    done = []

    def interrupt(*_, note=""):
        done.append(note)
        if len(done) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_cases(PAIR, REFERENCE, store=tmp_path, advance=interrupt)
    kept = list(tmp_path.iterdir())
    assert 1 <= len(kept) < len(batches_of(PAIR))
    driven = []
    drive = bench_run.result_of
    monkeypatch.setattr(bench_run, "result_of", lambda case, *rest: driven.append(case) or drive(case, *rest))
    assert run_cases(PAIR, REFERENCE, store=tmp_path) == results
    assert 0 < len(driven) < len(PAIR)
    before = len(driven)
    assert run_cases(PAIR, REFERENCE, store=tmp_path) == results
    assert len(driven) == before, "a finished batch must not run again"


def test_the_key_follows_everything_a_result_depends_on(tmp_path):
    """Catches a stale result: other cases, reference, seed, or another content of a user's file."""
    other = Reference(REFERENCE.file, match_stiffness=False)
    file = tmp_path / "mine.py"
    mine = [replace(PAIR[0], controller=f"{file}:make")]
    file.write_text("a = 1")
    keys = [
        key_of(PAIR[:1], REFERENCE, 0),
        key_of(PAIR[1:2], REFERENCE, 0),
        key_of(PAIR[:1], REFERENCE, 1),
        key_of(PAIR[:1], other, 0),
        key_of(mine, REFERENCE, 0),
    ]
    file.write_text("a = 2")
    keys.append(key_of(mine, REFERENCE, 0))
    assert len(set(keys)) == len(keys)
    assert Store(tmp_path, REFERENCE, 0).read(PAIR[:1]) is None


def test_the_exhibits_have_every_combination_once():
    """Catches a case left out or driven twice: 2 plants x 2 causalities x (12 complete, fast, ramp, 2 linear) each."""
    cases = bench_cases.grid()
    laws = len(CONTROLLERS)
    prompt = 4 * (laws - 1)  # the map has no feedback that delay could hurt
    assert len({case.name for case in cases}) == len(cases) == 4 * laws * (12 + 1 + 1 + 2) + prompt
    assert sum(case.prompt for case in cases) == prompt


def test_every_controller_meets_the_same_plant_and_every_place_another():
    """Catches plants that follow from the controller's name, or one plant drawn for all places."""
    seeds = Protocol.load().draw_seeds["test"]

    def plant_of(case):
        return bench_cases.task_of(case, REFERENCE, seeds).plant

    case = SCORED[0]
    assert plant_of(case) == plant_of(replace(case, controller="pid"))
    assert plant_of(case) != plant_of(replace(case, draw=1))
    assert plant_of(case) != plant_of(replace(case, speed_kmh=60.0))
    assert plant_of(case).believed() == PLANTS["SbW"], "a controller may know the nominal plant only"
    assert seeds[0] <= bench_cases.draw_seed(case, seeds) < seeds[1]


OWN = """
import controllers

class Stepwise:
    def __init__(self, inner):
        self.inner = inner
    def reset(self, period):
        self.inner.reset(period)
    def __call__(self, observation):
        return self.inner(observation)

def compiled(plant, reference, causality, **gains):
    return controllers.make("pid", plant, reference, causality, **gains)

def stepwise(plant, reference, causality):
    return Stepwise(controllers.make("pid", plant, reference, causality))
"""


def test_a_users_controller_joins_compiled_or_not_with_the_same_bits(tmp_path):
    """FILE.py:NAME with a pure law, and one that only has reset and __call__."""
    file = tmp_path / "mine.py"
    file.write_text(OWN)
    case = replace(SCORED[4], manoeuvre="step_steer")
    names = ("pid", f"{file}:compiled", f"{file}:stepwise")
    found = run_cases([replace(case, controller=name) for name in names], REFERENCE)
    assert found[1]["scores"] == found[0]["scores"]
    assert found[2]["scores"] == found[0]["scores"]
    alike = run_cases([replace(case, controller="given")], REFERENCE, makers={"given": lambda *a: _pid(*a)})
    assert alike[0]["scores"] == found[0]["scores"]


def _pid(plant, reference, causality):
    import controllers

    return controllers.make("pid", plant, reference, causality)


@pytest.mark.parametrize("wrong", ["nothing.py:make", "mine.py:missing", "broken.py:make", "pdi"])
def test_a_wrong_name_ends_at_once(tmp_path, wrong):
    (tmp_path / "mine.py").write_text("x = 1")
    (tmp_path / "broken.py").write_text("import nowhere_to_be_found")
    name = str(tmp_path / wrong) if ".py" in wrong else wrong
    done = CliRunner().invoke(main, ["benchmark", "--controller", name, "--out", str(tmp_path / "out")])
    assert done.exit_code == 2, done.output
    assert not (tmp_path / "out").exists()


def test_the_command_writes_scores_and_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "cases_of", lambda *_: [*PAIR, *SCORED])
    arguments = ["benchmark", "--out", str(tmp_path), "--quick", "--jobs", "1", "--json", "--only", "open_loop_map,pid"]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0, done.output
    printed = json.loads(done.stdout)
    scores = json.loads((tmp_path / "scores.json").read_text())
    assert printed["ranking"] == scores["ranking"]
    assert {s["controller"] for s in scores["ranking"]} == {"pid", "open_loop_map"}
    assert all(s["rank_interval"][0] <= s["rank"] <= s["rank_interval"][1] for s in scores["ranking"])
    assert len(scores["gates"]) == 2 * 4
    assert set(scores["step_cost"]) == {"pid", "open_loop_map"}
    with (tmp_path / "scores.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(PAIR) + len(SCORED)
    assert rows[0]["torque_hysteresis"] == ""
    assert float(rows[-1]["score_jnd"]) == scores["results"][-1]["score"]
    assert "pid" in (tmp_path / "report.html").read_text()


def fabricated(controller, error, linear=False, prompt=False, dB=0.5, deg=5.0, stable=True):
    f = np.array([0.5, 2.0, 3.9])
    ratio = 10.0 ** (np.array([0.0, 0.0, dB]) / 20.0)
    ones = np.ones(3)
    plot = {"frequency_Hz": f, "achieved_real": ratio, "achieved_imag": 0 * f,
            "reference_real": ones, "reference_imag": 0 * f}  # fmt: skip
    case = Case("EPAS", "impedance", controller, 75.0, CHIRP, "tense", linear, prompt)
    scores = {"tracking_relative": error, "worst_magnitude": dB, "worst_phase": deg}
    return {
        "case": dict(case.__dict__), "stable": stable, "scores": scores if stable else {},
        "plot": plot if stable else {},
    }  # fmt: skip


def test_the_words_follow_the_numbers():
    """Catches a verdict written beforehand: each number turns its sentence."""
    base = [fabricated("open_loop_map", 0.4), fabricated("pid", 0.1)]
    text = verdicts(base)[1].text
    assert "4.0 times" in text
    assert "clearly beaten" in text
    close = verdicts([fabricated("open_loop_map", 0.15), fabricated("pid", 0.1)])[1]
    assert "not clearly" in close.text
    inside = verdicts([*base, fabricated("pid", 0.1, linear=True)])[1]
    assert inside.within is True
    assert "stays within 0.50 dB and 5.0 deg" in inside.text
    out = [*base, fabricated("pid", 0.1, linear=True, dB=2.0)]
    beyond = verdicts([*out, fabricated("pid", 0.1, True, True, dB=0.3)])[1]
    assert beyond.within is False
    assert "at 3.9-3.9 Hz with the tense arm" in beyond.text
    assert "delay and sensors are the cause" in beyond.text
    law = verdicts([*out, fabricated("pid", 0.1, True, True, dB=1.9)])[1]
    assert "the law itself is the cause" in law.text
    thrown = verdicts([fabricated("open_loop_map", 0.4), fabricated("pid", 0.1, stable=False)])[1]
    assert thrown.short == "unstable in 1 case"
    assert thrown.error is None
