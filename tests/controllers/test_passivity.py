"""The passivity wrapper: silent around what is passive, quick around what is not, and around any law."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

import controllers
from controllers import CAUSALITIES, CONTROLLERS, lead, passivity, pid
from controllers.law import Factor
from controllers.passivity import EnergyState, coefficient, damped, observe, yielding
from experiments.measures import high_passed, rms
from experiments.rollout import run
from steer_env.envs.layout import PERIOD
from steer_env.envs.task import Task
from steer_env.errors import InputError
from steer_env.interface import Observation
from steer_env.physics.reference import ReferenceState, admittance_step
from steer_env.plants import PLANTS, Reference

LOOPS = list(product(PLANTS, CAUSALITIES))
REST = Observation(*[0.0] * 13)._replace(speed=75.0 / 3.6)

OWN = """
from controllers import pid
from controllers.law import Factor, LawController
from steer_env.physics._jit import scalar

@scalar
def heavy_torque(o, x, p):
    command, state = pid.torque_law(o, x, p)
    return command - 1.0 * o.pinion_rate / p.motor_ratio, state

@scalar
def heavy_angle(o, x, p):
    command, state = pid.angle_law(o, x, p)
    return command - 1.0 * o.pinion_rate / p.motor_ratio, state

def heavy(plant, reference, causality, **gains):
    law = heavy_torque if causality == "impedance" else heavy_angle
    return LawController(law, lambda period: pid.design(plant, reference, period), pid.PidState())

def cold(plant, reference, causality, **gains):
    return pid.make(plant, reference, causality)

def hot(plant, reference, causality, **gains):
    if causality == "impedance":
        return pid.make(plant, reference, causality, torque_integral=150.0)
    return pid.make(plant, reference, causality, angle_gain=Factor(8.0))
"""


@cache
def reference(linear=False):
    return Reference.load("published", linear)


@pytest.fixture
def own(tmp_path):
    """FILE.py of laws that give less than the reference does (1 N m s/rad more of damping), or more; pid untuned."""
    path = tmp_path / "own_laws.py"
    path.write_text(OWN)
    return str(path)


def made(name, plant, causality, **gains):
    return controllers.make(name, PLANTS[plant], reference(), causality, **gains)


def late(plant, dead_time):
    """A plant whose commands come later than its controller was told."""
    return replace(PLANTS[plant], motor=PLANTS[plant].motor._replace(dead_time=float(dead_time)))


def driven(plant, causality, law, hardware=None, driver="relaxed", speed_kmh=75.0):
    manoeuvre = "random_torque" if driver == "hands_off" else "on_centre_weave"
    task = Task(
        hardware or plant, causality, reference(), manoeuvre=manoeuvre, speed_kmh=speed_kmh, driver=driver, duration=5.0
    )
    return run(task, law, seed=1)


def shake(episode):
    """Torsion-bar torque above 8 Hz in N m rms: what no driver means."""
    return rms(high_passed(episode["torsion_bar_torque"], 8.0, PERIOD))


def given(episode):
    """Most energy in J that the true port gave beyond the ideal reference within a memory of 0.5 s (impedance)."""
    missing, angle = episode["reference"] - episode["torsion_bar_torque"], episode["pinion_angle"]
    energy, most = 0.0, 0.0
    for step in 0.5 * (missing[1:] + missing[:-1]) * np.diff(angle):
        energy = np.exp(-PERIOD / 0.5) * energy + step
        most = max(most, energy)
    return most


@pytest.mark.parametrize(("plant", "causality"), LOOPS)
def test_around_a_passive_law_it_does_nothing(own, plant, causality):
    """With damping on top of the reference: catches a count of the wrong sign or bias, and a bit that changes."""
    for driver in ("hands_off", "tense"):
        bare = driven(plant, causality, made(f"{own}:heavy", plant, causality), driver=driver)
        wrapped = driven(plant, causality, made(f"passivity:{own}:heavy", plant, causality), driver=driver)
        assert np.array_equal(bare.signals, wrapped.signals)


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize(("plant", "causality"), [("EPAS", "impedance"), ("SbW", "admittance")])
def test_it_works_around_every_row_and_hardly_costs_tracking(name, plant, causality):
    """Catches nested records that do not compile, and a wrapper that resists plain steering."""
    bare = driven(plant, causality, made(name, plant, causality))
    wrapped = driven(plant, causality, made(f"passivity:{name}", plant, causality))
    assert wrapped.stable
    assert rms(wrapped["error"]) < 1.1 * rms(bare["error"])


@pytest.mark.parametrize(
    ("plant", "causality", "dead_time", "driver"),
    [("EPAS", "impedance", 5, "one_hand_light"), ("EPAS", "admittance", 4, "relaxed"),
     ("SbW", "admittance", 8, "hands_off")],
)  # fmt: skip
def test_it_quiets_what_a_delay_makes_active(own, plant, causality, dead_time, driver):
    """Commands some ms later than the law was designed for: bare, the oscillation grows as far as limits let it."""
    hardware = late(plant, dead_time)
    speed = 75.0 if plant == "EPAS" else 45.0
    bare = driven(plant, causality, made(f"{own}:cold", plant, causality), hardware, driver, speed)
    wrapped = driven(plant, causality, made(f"passivity:{own}:cold", plant, causality), hardware, driver, speed)
    assert wrapped.stable
    assert shake(bare) > 1.0
    assert shake(wrapped) < (0.45 if bare.stable else 0.15) * shake(bare)
    if causality == "impedance":
        assert given(wrapped) < 0.5 * given(bare)


@pytest.mark.parametrize("causality", CAUSALITIES)
def test_it_quiets_too_much_gain(own, causality):
    """Steer-by-wire with many times the integral or angle gain, free wheel."""
    bare = driven("SbW", causality, made(f"{own}:hot", "SbW", causality), driver="hands_off")
    wrapped = driven("SbW", causality, made(f"passivity:{own}:hot", "SbW", causality), driver="hands_off")
    assert shake(bare) > 0.8
    assert shake(wrapped) < 0.5 * shake(bare)
    if causality == "impedance":
        assert given(wrapped) < 0.5 * given(bare)


def test_the_observer_counts_torque_times_displacement():
    """M_tb lacks d times the rate in a sine: E grows by (d - allowed) times the integral of rate^2."""
    lacking, w = 1.5, 2.0 * np.pi * 4.0
    p = made("passivity", "EPAS", "impedance", memory=1e3).parameters
    x = EnergyState()
    for k in range(1001):
        angle, rate = 0.1 * np.sin(w * k * PERIOD), 0.1 * w * np.cos(w * k * PERIOD)
        o = REST._replace(pinion_angle=angle, pinion_rate=rate, reference=2.0, torsion_bar_torque=2.0 - lacking * rate)
        x = observe(o, x, p)
    assert x.energy == pytest.approx((lacking - p.allowed_damping) * 0.5 * (0.1 * w) ** 2, rel=2e-3)
    p = p._replace(memory=0.1)
    left = observe(o, x, p).energy  # one more period at another memory
    assert left < x.energy
    for _ in range(100):
        x = observe(o._replace(pinion_rate=0.0), x, p)
    assert x.energy == pytest.approx(left * np.exp(-1.0), rel=0.02), "forgotten by 1/e after a memory"


def test_in_admittance_the_reference_is_taken_back_to_the_measured_motion():
    """A linear reference moved by 1/0.9 of the torque: at the motion of the plant nothing may lack.

    The car's answer is taken as its steady stiffness, so a slow motion is looked at.
    """
    row = reference(True).at(REST.speed)
    law = controllers.make("passivity", PLANTS["EPAS"], reference(True), "admittance")
    generator, x, lacking, torques = ReferenceState(*[0.0] * 8), EnergyState(), [], []
    for k in range(20000):
        torque = 3.0 * np.sin(2.0 * np.pi * 0.2 * k * PERIOD)
        a, generator = admittance_step(torque, generator, REST.speed, row, PERIOD)
        o = REST._replace(
            pinion_angle=0.9 * generator.pinion_angle, pinion_rate=0.9 * generator.pinion_rate,
            pinion_acceleration=0.9 * a, reference=generator.pinion_angle, reference_rate=generator.pinion_rate,
            reference_acceleration=a, torsion_bar_torque=torque, effective_torque=generator.effective_torque,
        )  # fmt: skip
        x = observe(o, x, law.parameters)
        lacking.append(x.missing)
        torques.append(torque)
    expected = -0.1 * np.array(torques)
    assert rms(np.array(lacking)[10000:] - expected[10000:]) < 0.12 * rms(expected[10000:])


def test_the_excess_is_taken_back_within_the_delay_and_never_more():
    """The coefficient times size^2 times T_d is the excess, up to the limit; none without excess or motion."""
    p = made("passivity", "EPAS", "impedance").parameters
    some = EnergyState(energy=p.allowance + 1e-3)
    assert coefficient(some, 1.0, 1e9, p) * p.delay == pytest.approx(1e-3)
    assert coefficient(some, 1e-6, p.damping_limit, p) == p.damping_limit
    assert coefficient(some, 0.0, p.damping_limit, p) == p.damping_limit
    assert coefficient(EnergyState(energy=p.allowance), 1.0, p.damping_limit, p) == 0.0
    assert coefficient(EnergyState(energy=-5.0), 1.0, p.damping_limit, p) == 0.0


def test_gains_go_to_the_wrapper_and_the_inner_law_keeps_its_own(monkeypatch):
    """Catches gains that reach the wrong record, and an inner law without its shipped gains."""
    shipped = {"pid": {"torque_gain": Factor(0.5)}}
    monkeypatch.setattr(controllers.tuning, "gains_for", lambda name, plant, causality: shipped.get(name, {}))
    law = made("passivity:pid", "EPAS", "impedance", allowance=0.2)
    assert law.parameters.allowance == 0.2
    own, alone = law.parameters.inner, made("pid", "EPAS", "impedance").parameters
    assert all(np.array_equal(getattr(own, name), getattr(alone, name)) for name in alone._fields)
    assert law.parameters.inner.torque_gain == 0.5
    assert made("passivity", "EPAS", "impedance").parameters.inner.torque_gain == 0.5
    with pytest.raises(InputError, match="allowed_damping"):
        made("passivity:pid", "EPAS", "impedance", torque_gain=1.0)
    with pytest.raises(InputError, match="open_loop_map"):
        made("passivity:pdi", "EPAS", "impedance")
    law.reset(2e-3)
    assert law.parameters.inner.period == law.parameters.period == 2e-3


def test_wrapped_laws_carry_names_of_their_own():
    """Machine code is linked by name: two laws in one wrapper must not share one (see test_closure_names)."""
    laws = (pid.torque_law, pid.angle_law, lead.torque_law, lead.angle_law)
    names = [wrap(law).__qualname__ for wrap in (damped, yielding) for law in laws]
    assert len(set(names)) == len(names)
    assert damped(pid.torque_law) is damped(pid.torque_law), "compiled once"
    assert passivity.make(PLANTS["EPAS"], reference(), "impedance").law is damped(pid.torque_law)
