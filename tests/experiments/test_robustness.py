"""The gate: wrong controllers are caught, right ones are not blamed for the reference, and the command says so."""

import json
from itertools import product

import numpy as np
import pytest
from click.testing import CliRunner

import controllers
from experiments.assessment import Assessment, assess
from experiments.loop_simulation import confirm, worst_stuck
from experiments.robustness import command, safe
from steer_env.errors import InputError
from steer_env.plants import DRIVERS, PLANTS, Reference
from steer_env.units import quantities
from tests.experiments.wrong_controllers import spoilt

REFERENCE = Reference.load("published")
SYSTEMS = list(product(PLANTS, controllers.CAUSALITIES))


@pytest.mark.parametrize(("plant", "causality"), SYSTEMS)
def test_wrong_controllers_are_unsafe_and_the_right_one_is_not(plant, causality):
    """A flipped sign, a command five times too large, 10 ms more delay: each at 75 km/h, in every system."""
    assert safe(assess(spoilt(), plant, causality, REFERENCE, [75.0])).safe
    for wrong in (spoilt(factor=-1.0), spoilt(factor=5.0), spoilt(late=True)):
        gate = safe(assess(wrong, plant, causality, REFERENCE, [75.0]))
        assert not gate.safe
        assert gate.failures
        assert gate.disk_margin == gate.delay_margin_ms == 0.0
        assert gate.growth > 0.0


def pid_at(plant, causality, speeds, **more):
    def make(*told):
        return controllers.make("pid", *told, tuned=False)

    return assess(make, plant, causality, REFERENCE, speeds, **more)


def test_what_the_reference_cannot_do_is_not_held_against_a_controller():
    """15 km/h, friction stuck: the reference grows by itself (b_ref < 0), and so does a loop that tracks it."""
    found = pid_at("EPAS", "impedance", [15.0], points=["centre_stuck"])
    grows = [a for a in found if not a.stable]
    assert grows
    assert all(a.reference_growth > 1.0 for a in grows)
    gate = safe(found + pid_at("EPAS", "impedance", [75.0]))
    assert gate.safe
    assert len(gate.reference_failures) == len(grows)
    assert "15 km/h, centre_stuck, hands_off" in gate.reference_failures[0]
    with pytest.raises(InputError, match="nothing to judge"):
        safe([])


@pytest.mark.parametrize(("factor", "thrown"), [(1.3, False), (5.0, True)])
def test_an_unsafe_place_is_unsafe_in_the_program_too(factor, thrown):
    """pid with its gain margin of 1.5 dB used up grows as the eigenvalue says, until friction holds it in a limit
    cycle that a hand feels; five times too strong it throws the wheel."""
    plant, wrong = PLANTS["EPAS"], spoilt(factor)
    found = assess(wrong, plant, "impedance", REFERENCE, [75.0], points=["centre_stuck"])
    gate = safe(found)
    assert len(gate.failures) == len(DRIVERS)
    assert not gate.reference_failures
    seen = confirm(wrong(plant, REFERENCE, "impedance"), plant, REFERENCE, worst_stuck(found))
    assert seen.thrown == thrown
    if not thrown:
        right = confirm(spoilt()(plant, REFERENCE, "impedance"), plant, REFERENCE, worst_stuck(found))
        assert seen.left_Nm > max(0.05, 4.0 * right.left_Nm)
        assert seen.agrees
        assert seen.simulated_growth == pytest.approx(seen.growth, rel=0.05)


def test_a_law_that_does_not_look_at_the_reference_does_not_care_what_it_is():
    """The EPAS map is one law: the same growth in both causalities, whatever the generator beside it does."""

    def make(*told):
        return controllers.make("open_loop_map", *told, tuned=False)

    both = [assess(make, "EPAS", causality, REFERENCE, [15.0]) for causality in controllers.CAUSALITIES]
    for one, other in zip(*both, strict=True):
        assert one.growth == pytest.approx(other.growth, rel=1e-3)


def test_hardware_that_is_not_what_the_controller_was_told():
    """A draw that is late by more than the delay margin is unstable; the nominal plant as hardware changes nothing."""
    nominal, rng = PLANTS["EPAS"], np.random.default_rng(1)
    draws = [nominal.drawn(rng) for _ in range(20)]
    arms = {"relaxed": DRIVERS["relaxed"]}
    one, same, other = (
        pid_at("EPAS", "impedance", [75.0], arms=arms, points=["centre_stuck"], hardware=hardware)[0]
        for hardware in (None, nominal, next(d for d in draws if d.motor.dead_time == 3.0))
    )
    assert one == same
    assert one.stable
    assert one.delay_margin_ms < 1.0
    assert not other.stable, "two periods more than the delay margin allows"


def test_an_assessment_is_flat_and_goes_to_json_as_it_is():
    (one, *_) = pid_at("SbW", "impedance", [75.0], points=["centre_stuck"])
    assert json.loads(json.dumps(one._asdict(), allow_nan=False)) == one._asdict()
    assert all(isinstance(value, str | float | bool) for value in one)
    assert not quantities(Assessment)


def test_the_command_writes_what_it_says(tmp_path):
    """One controller at one speed; also catches NaN in the file and a table without its verdicts."""
    wanted = ["--quick", "--controller", "pid", "--jobs", "1", "--quiet", "--out", str(tmp_path)]
    result = CliRunner().invoke(command, wanted)
    assert result.exit_code == 0, result.output
    assert result.stdout.count(" safe") == len(SYSTEMS)
    written = json.loads((tmp_path / "robustness.json").read_text("utf-8"))
    assert {(g["plant"], g["causality"]) for g in written["gates"]} == set(SYSTEMS)
    assert len(written["assessments"]) == len(SYSTEMS) * 4 * len(DRIVERS)
    assert all(c["agrees"] for c in written["confirmations"])
    again = CliRunner().invoke(command, [*wanted, "--json"])
    printed = json.loads(again.stdout)
    assert printed["gates"] == written["gates"]
    assert "assessments" not in printed
