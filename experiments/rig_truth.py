"""What a simulation would have known of a virtual motor's episode: true signals and the ideal reference."""

from __future__ import annotations

import numpy as np

from experiments.rollout import Array
from steer_env.envs import batch
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Truth
from steer_env.envs.parts import judged, truth_of
from steer_env.envs.task import Setup
from steer_env.manoeuvres import hand_at
from steer_env.physics import vehicle
from steer_env.physics._jit import compiled
from steer_env.physics.plant import PlantState, motion_of
from steer_env.physics.reference import ReferenceState, single_track_of
from steer_env.physics.steering import torsion_bar_torque
from steer_env.physics.vehicle import SingleTrackState

_steering, _motor = PARAMETERS.loader("steering"), PARAMETERS.loader("motor")
_driver, _manoeuvre = PARAMETERS.loader("driver"), PARAMETERS.loader("manoeuvre")
_episode, _reward = PARAMETERS.loader("episode"), PARAMETERS.loader("reward")
_load_reference, _load_track, _load_car = STATE.loader("reference"), STATE.loader("track"), STATE.loader("car")


def true_signals(setup: Setup, states: Array, commands: Array) -> Array:
    """Truth [n, fields] from the virtual wheel's states [n, fields of PlantState] and the commands [n] in N m.

    By the simulation's own functions, ideal reference included; the car follows the true pinion angle.
    """
    parameters, rows, lines = batch.new_rows(1)
    parameters[0] = setup.row
    batch.start_batch(parameters, rows, lines, setup.table, setup.car_table)
    signals = np.zeros((len(states), len(Truth._fields)))
    _judge(states, commands, parameters[0], rows[0], signals)
    return signals


@compiled
def _judge(states: Array, commands: Array, p_row: Array, s_row: Array, signals: Array) -> None:
    steering, motor, driver, manoeuvre = _steering(p_row), _motor(p_row), _driver(p_row), _manoeuvre(p_row)
    episode, weights = _episode(p_row), _reward(p_row)
    reference, columns, car = _load_reference(s_row), _load_track(s_row), _load_car(s_row)
    body, speed = single_track_of(car), episode.speed
    track = SingleTrackState(0.0, 0.0, 0.0, 0.0)
    judge = ReferenceState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    before, last = 0.0, 0.0
    for k in range(states.shape[0]):
        s = states[k]
        now = s[2] * (1.0 / car.i_s)
        track = vehicle.single_track_step(track, before, 0.5 * (before + now), now, speed, body, PERIOD)
        before = now
        x = PlantState(
            s[0], s[1], s[2], s[3], track.lateral_speed, track.yaw_rate, track.slip_front, track.slip_rear,
            s[8], s[9], s[10], s[11], s[12],
        )  # fmt: skip
        hand = hand_at(episode.kind, (k + 0.5) * PERIOD, manoeuvre)
        M_tb = torsion_bar_torque(motion_of(x), steering)
        ideal, error, cost, judge = judged(
            x, M_tb, hand, speed, judge, episode, weights, steering, driver, reference, columns, car, None
        )
        verdict = ideal, error, cost
        truth = truth_of(
            k, x, M_tb, commands[k], last, verdict, hand, speed, episode.rack_share, motor, weights, driver, car, None
        )
        last = commands[k]
        for j in range(len(truth)):
            signals[k, j] = truth[j]
