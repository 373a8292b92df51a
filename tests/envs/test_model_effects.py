"""Environments with a model: its effects act in the plant and in its sensors, its reference stays what it is."""

import json
import math
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from controllers import make
from experiments.rollout import run
from steer_env.envs.cell import rows_of
from steer_env.envs.layout import Truth
from steer_env.envs.task import Task
from steer_env.errors import InputError
from steer_env.physics.effects import EFFECTS
from steer_env.physics.sensors import Sensors
from steer_env.plants import PLANTS
from steer_env.plants.model_file import ExtendedModel, read_model, write_model
from steer_env.plants.reference import Reference
from steer_env.plants.reference_file import published

ID = "steer_env/EPAS-Impedance-v0"
PUBLISHED = published()
EXACT = Sensors(angle_step=0.0, torque_step=0.0, torque_noise=0.0, angle_delay=0.0, torque_delay=0.0)
VEHICLE = EFFECTS["vehicle"]
MANY = ("universal_joint", "backlash", "tyre_scrub", "column_friction", "torque_gain", "latency_torque")


def model_of(*names: str, **values: float) -> ExtendedModel:
    """The published reference with effects at their first probe, or at ``values``."""
    effects = {name: VEHICLE[name].at(values or VEHICLE[name].probes[0])._asdict() for name in names}
    return ExtendedModel(PUBLISHED, effects, {})


def drive(periods: int, seed: int = 4, **options: object) -> np.ndarray:
    """Truth and observation in SI [periods, fields] under a slow sine of the motor."""
    env = gymnasium.make(ID, **options)
    env.reset(seed=seed)
    rows = []
    for k in range(periods):
        *_, info = env.step(np.array([0.1 * math.sin(0.02 * k)], np.float32))
        rows.append((*(info[name] for name in Truth._fields), *info["observation"]))
    return np.array(rows)


def column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, Truth._fields.index(name)]


def sensed(rows: np.ndarray, field: int) -> np.ndarray:
    """A column of the observation: 0 the pinion angle, 3 the torsion-bar torque."""
    return rows[:, len(Truth._fields) + field]


def test_without_effects_a_model_is_its_reference() -> None:
    """Catches a plant or reference that a model changes by being there; an absent effect adds nothing to the bit."""
    plain = drive(1500)
    assert np.array_equal(drive(1500, model=ExtendedModel(PUBLISHED, {}, {})), plain)
    absent = ExtendedModel(PUBLISHED, {name: e.absent()._asdict() for name, e in VEHICLE.items()}, {})
    assert np.array_equal(drive(1500, model=absent), plain)


def test_bits_are_those_before_there_were_effects() -> None:
    """Recorded before the ports were put in; the plant of whoever has no model must not move."""
    env = gymnasium.make(ID)
    env.reset(seed=3)
    for k in range(3000):
        *_, info = env.step(np.array([0.1 * np.sin(k * 0.01)], np.float32))
    assert info["torsion_bar_torque"] == pytest.approx(6.471204787251443, rel=1e-9)
    assert info["rack_torque"] == pytest.approx(-2.1829676813237633, rel=1e-9)


@pytest.mark.parametrize("names", [MANY, ("suspension_compliance", "variable_ratio", "stribeck_friction")])
def test_single_vector_and_compiled_episode_give_the_same_bits(names: tuple[str, ...]) -> None:
    """Catches a way to step that forgets the effects, or takes those of another environment."""
    model = model_of(*names)
    many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="vector_entry_point", model=model)
    many.reset(seed=4)
    single = [drive(700, seed, model=model) for seed in (4, 5)]
    for k in range(700):
        *_, infos = many.step(np.full((2, 1), 0.1 * math.sin(0.02 * k), np.float32))
        for i in range(2):
            assert all(infos[name][i] == single[i][k, j] for j, name in enumerate(Truth._fields))
    task = Task(model=model, manoeuvre="step_steer", duration=0.3)
    law = run(task, make("pid", PLANTS["EPAS"], model.feel, "impedance"), seed=1)

    class Called:
        """The same controller without its law, so that it is called from Python, step by step."""

        def __init__(self) -> None:
            self.inner = make("pid", PLANTS["EPAS"], model.feel, "impedance")

        def reset(self, dt: float) -> None:
            self.inner.reset(dt)

        def __call__(self, observation: object) -> float:
            return self.inner(observation)

    assert np.array_equal(law.signals, run(task, Called(), seed=1).signals)


def test_torque_sensor_reads_gain_and_offset_exactly() -> None:
    """Reading = 1.1 M_tb + 0.2 where nothing else is wrong with it, also beside ``sensors``."""
    effects = {"torque_gain": {"ratio": 1.1}, "torque_offset": {"Nm": 0.2}}
    rows = drive(400, model=ExtendedModel(PUBLISHED, effects, {}), sensors=EXACT)
    assert np.abs(column(rows, "torsion_bar_torque")).max() > 0.3
    np.testing.assert_allclose(sensed(rows, 3), 1.1 * column(rows, "torsion_bar_torque") + 0.2, rtol=1e-12)


def test_latency_is_whole_periods_on_top_of_the_sensor() -> None:
    """A lateness of 5 ms: what is read now is what was true five periods ago."""
    late = EXACT._replace(torque_delay=2.0)
    rows = drive(400, model=model_of("latency_torque", delay_s=0.005), sensors=late)
    np.testing.assert_array_equal(sensed(rows, 3)[107:], column(rows, "torsion_bar_torque")[100:-7])
    with pytest.raises(InputError, match="remembers"):
        gymnasium.make(ID, model=model_of("latency_torque", delay_s=0.02))


def test_rack_torque_is_the_tyres_own_when_bushes_give_way() -> None:
    """In steady cornering C_f a_f n_t / i_s with the slip that the tyre has: kinematic slip without what the
    compliance takes would be two fifths too large.
    """
    car = Reference(PUBLISHED, match_stiffness=False)
    p = car.at(75.0 / 3.6)
    assert p.relaxed == 0.0
    settings = {"reference": "published", "manoeuvre": "step_steer", "duration": 3.0}
    env = gymnasium.make(ID, model=model_of("suspension_compliance", rad_per_N=3e-6), **settings)
    env.reset(seed=1)
    for _ in range(3000):
        *_, info = env.step(np.zeros(1, np.float32))
    force = p.m * info["lateral_acceleration"] * p.l_r / (p.l_f + p.l_r)
    assert abs(force) > 500.0
    extra = env.unwrapped.reference.at(75.0 / 3.6).c_extra * info["pinion_angle"]
    assert info["rack_torque"] - extra == pytest.approx(force * p.n_t / p.i_s, rel=0.03)


def test_rack_torque_told_is_the_one_that_loads_the_pinion() -> None:
    """Steadily held, torsion bar and motor carry rack and friction: the told rack torque closes the balance."""
    model = model_of("jacking_torque", stiffness_Nm_per_rad=1.5)
    env = gymnasium.make(ID, model=model, manoeuvre="step_steer", duration=3.0)
    env.reset(seed=1)
    for _ in range(3000):
        *_, info = env.step(np.zeros(1, np.float32))
    assert abs(info["pinion_rate"]) < 2e-3
    lifted = 1.5 * info["pinion_angle"]
    assert abs(lifted) > 0.2
    friction = env.unwrapped.plant.steering.M_fric
    assert abs(info["torsion_bar_torque"] - info["rack_torque"]) <= 1.001 * friction
    steering = rows_of(env.unwrapped._cell)[1][0][9]
    assert info["torsion_bar_torque"] == pytest.approx(info["rack_torque"] + steering, abs=0.02)


def test_a_model_brings_its_own_reference(tmp_path: Path) -> None:
    """A second one would be dropped silently; and the model's own file gives the environment back."""
    model = model_of(*MANY)
    with pytest.raises(InputError, match="reference"):
        gymnasium.make(ID, model=model, reference=Reference(PUBLISHED))
    write_model(tmp_path / "model.json", model)
    assert read_model(tmp_path / "model.json").effects == model.effects
    assert np.array_equal(drive(300, model=str(tmp_path / "model.json")), drive(300, model=model))
    assert gymnasium.make(ID, model=model).unwrapped.reference.file == PUBLISHED


def test_twice_the_same_effect_is_refused(tmp_path: Path) -> None:
    """The second would silently win; a provenance that is no table is refused by name too."""
    path = tmp_path / "model.json"
    write_model(path, model_of("backlash"))
    table = json.loads(path.read_text())
    path.write_text(json.dumps({**table, "effects": 2 * table["effects"]}))
    with pytest.raises(InputError, match=r"effects\[1\].*'backlash' stands twice"):
        read_model(path)
    path.write_text(json.dumps({**table, "provenance": 1}))
    with pytest.raises(InputError, match="provenance"):
        read_model(path)
