"""The control period of WIDTH environments side by side: the same functions as ``control_period``, in loops over lanes.

The compiler turns the loops over lanes into vector code, four or eight environments at a time, where everything in them
is arithmetic and choices; delay lines, hands and laws, which look things up or call the C library, have scalar loops of
their own. Every environment gets the bits that ``control_period`` gives it alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, Clock, Truth
from steer_env.envs.parts import driven, judged, next_speed, readings, set_speed, through, truth_of
from steer_env.manoeuvres import MANOEUVRES
from steer_env.physics._jit import named, scalar
from steer_env.physics.control_unit import Commands, Observation, control_unit_step
from steer_env.physics.driver import Hand
from steer_env.physics.lanes import WIDTH, lane_loader, lane_storer
from steer_env.physics.motor import limited_command
from steer_env.physics.rows import Layout

Array = NDArray[np.float64]
Signal = tuple[Callable[[float, Any], Hand], tuple[float, ...]]


class Switches(NamedTuple):
    """What is the same in all lanes, so that compiled code need not carry the other case along.

    1 or 0 as in ``Episode`` and ``ReferenceParameters``. Lanes have Dahl friction and no effects of the catalogue.
    """

    admittance: float
    linear: float
    relaxed_reference: float
    relaxed_car: float


class Wires(NamedTuple):
    """What goes from one loop over the lanes to the next, SI."""

    period: float
    speed: float
    command: float
    limited: float
    target: float
    noise_angle: float
    noise_torque: float
    angle: float
    torque: float
    motor_torque: float


BENCH = Layout(wires=Wires, hand=Hand, observation=Observation, truth=Truth)
"""What the loops over the lanes hand on to each other."""
# One array [BLOCK_SIZE, WIDTH] holds all of a block but its delay lines: with several the compiler would have to prove,
# or to check in every period, that none of them overlap.
PARAMETER_ROWS = slice(0, PARAMETERS.size)
STATE_ROWS = slice(PARAMETERS.size, PARAMETERS.size + STATE.size)
BENCH_ROWS = slice(STATE_ROWS.stop, STATE_ROWS.stop + BENCH.size)
BLOCK_SIZE = BENCH_ROWS.stop
START = {id(PARAMETERS): 0, id(STATE): STATE_ROWS.start, id(BENCH): BENCH_ROWS.start}


def switches_of(row: Array, table: Array, car_table: Array) -> Switches | None:
    """The switches of an environment's parameter row and tables; None where lanes cannot run it."""
    steering = PARAMETERS.read(row, "steering")
    fields = [table[:, 1 + k] for k in _SWITCHED] + [car_table[:, 1 + _SWITCHED[1]]]
    if steering.M_fric_extra > 0.0 or steering.sigma_1 > 0.0 or any((f != f[0]).any() for f in fields):
        return None
    return Switches(PARAMETERS.read(row, "episode").admittance, *(float(f[0]) for f in fields))


def _lanes(layout: Layout, name: str, **fixed: float) -> tuple[Callable[..., Any], Callable[..., None]]:
    record, start = layout.records[name], START[id(layout)] + layout[name].start
    return lane_loader(record, start, fixed), lane_storer(record, start)


_SWITCHED = [STATE.records["reference"]._fields.index(name) for name in ("linear", "relaxed")]
_motor, _ = _lanes(PARAMETERS, "motor")
_driver, _ = _lanes(PARAMETERS, "driver")
_sensors, _ = _lanes(PARAMETERS, "sensors")
_observer, _ = _lanes(PARAMETERS, "observer")
_manoeuvre, _ = _lanes(PARAMETERS, "manoeuvre")
_weights, _ = _lanes(PARAMETERS, "reward")
_steering, _ = _lanes(PARAMETERS, "steering", M_fric_extra=0.0, sigma_1=0.0)
_plant, _store_plant = _lanes(STATE, "plant")
_seen, _store_seen = _lanes(STATE, "observer")
_generator, _store_generator = _lanes(STATE, "generator")
_judge, _store_judge = _lanes(STATE, "judge")
_commands, _store_commands = _lanes(STATE, "commands")
_clock, _store_clock = _lanes(STATE, "clock")
_track, _ = _lanes(STATE, "track")
_wires, _store_wires = _lanes(BENCH, "wires")
_hand, _store_hand = _lanes(BENCH, "hand")
_any_episode, _ = _lanes(PARAMETERS, "episode")
load_observation, store_observation = _lanes(BENCH, "observation")
load_truth, store_truth = _lanes(BENCH, "truth")


def row_of(layout: Layout, record: str, field: str) -> int:
    """Row of the block in which a field lies."""
    return START[id(layout)] + layout.column(record, field)


COMMAND, NOISE_ANGLE, NOISE_TORQUE, K, LIMITED, TARGET, ANGLE, TORQUE, MOTOR_TORQUE = (
    row_of(BENCH, "wires", name)
    for name in (
        "command",
        "noise_angle",
        "noise_torque",
        "period",
        "limited",
        "target",
        "angle",
        "torque",
        "motor_torque",
    )
)
DEAD_TIME, ANGLE_DELAY = row_of(PARAMETERS, "motor", "dead_time"), row_of(PARAMETERS, "sensors", "angle_delay")
TORQUE_DELAY, SPEED = row_of(PARAMETERS, "sensors", "torque_delay"), row_of(STATE, "clock", "speed")
KIND, SPEED_RATE = row_of(PARAMETERS, "episode", "kind"), row_of(PARAMETERS, "episode", "speed_rate")


@scalar
def _accelerate(lane: int, b: Any, table: Any, car_table: Any) -> None:
    """Reference and car of a lane at a speed that changes."""
    before = b[SPEED, lane]
    speed = next_speed(before, _any_episode(b, lane))
    if speed != before:
        set_speed(speed, b[PARAMETER_ROWS, lane], b[STATE_ROWS, lane], table, car_table)


@scalar
def _command(lane: int, b: Any) -> None:
    """Clock and limited command of one lane."""
    clock, given = _clock(b, lane), _wires(b, lane)
    speed = next_speed(clock.speed, _any_episode(b, lane))
    limited = limited_command(given.command, _commands(b, lane).last_1, _motor(b, lane), PERIOD)
    now = given.noise_angle, given.noise_torque
    _store_wires(b, lane, Wires(clock.period, speed, given.command, limited, 0.0, *now, 0.0, 0.0, 0.0))


def _hands(signals: list[Signal]) -> Callable[[float, Any], None]:
    """A function (kind, block) that stores what the hands of all lanes do in one kind of manoeuvre."""
    signal, numbers = signals[0][0], signals[0][1]

    def lanes(b: Any) -> None:
        for lane in range(WIDTH):
            _store_hand(b, lane, signal((_wires(b, lane).period + 0.5) * PERIOD, _manoeuvre(b, lane)))

    move = scalar(named(lanes, *numbers))
    if len(signals) == 1:

        def last(kind: float, b: Any) -> None:
            move(b)

        return scalar(named(last, *numbers))
    others = _hands(signals[1:])

    def chosen(kind: float, b: Any) -> None:
        if kind in numbers:
            move(b)
        else:
            others(kind, b)

    return scalar(named(chosen, *numbers))


_move_hands = _hands(
    [
        (signal, tuple(float(k) for k, row in enumerate(MANOEUVRES.values()) if row.signal is signal))
        for signal in dict.fromkeys(row.signal for row in MANOEUVRES.values())
    ]
)


def make_lanes_period(switches: Switches) -> Callable[..., None]:
    """One period of a block: (block [BLOCK_SIZE, WIDTH], lines [4, 16, WIDTH], table, car table).

    Commands in N m and noise stand in the wires; observations and truths are left in the block.
    """
    episode_of, _ = _lanes(PARAMETERS, "episode", admittance=switches.admittance)
    reference_of, _ = _lanes(STATE, "reference", linear=switches.linear, relaxed=switches.relaxed_reference)
    car_of, _ = _lanes(STATE, "car", relaxed=switches.relaxed_car)

    def drive(lane: int, b: Any) -> None:
        """Plant, judge and sensors of one lane."""
        w, hand, episode, weights = _wires(b, lane), _hand(b, lane), episode_of(b, lane), _weights(b, lane)
        steering, motor, driver = _steering(b, lane), _motor(b, lane), _driver(b, lane)
        reference, car, share = reference_of(b, lane), car_of(b, lane), episode.rack_share
        x, M_tb = driven(
            _plant(b, lane), w.target, hand, w.speed, share, steering, motor.bandwidth_Hz, driver, car, None
        )
        ideal, error, cost, judge = judged(
            x,
            M_tb,
            hand,
            w.speed,
            _judge(b, lane),
            episode,
            weights,
            steering,
            driver,
            reference,
            _track(b, lane),
            car,
            None,
        )
        angle, torque = readings(x, M_tb, w.noise_angle, w.noise_torque, _sensors(b, lane))
        verdict, last = (ideal, error, cost), _commands(b, lane).last_1
        truth = truth_of(
            w.period, x, M_tb, w.limited, last, verdict, hand, w.speed, share, motor, weights, driver, car, None
        )
        now = Wires(w.period, w.speed, w.command, w.limited, w.target, 0.0, 0.0, angle, torque, x.motor_torque)
        _store_plant(b, lane, x)
        _store_judge(b, lane, judge)
        store_truth(b, lane, truth)
        _store_wires(b, lane, now)

    def see(lane: int, b: Any) -> None:
        """The control unit of one lane."""
        w, before, clock = _wires(b, lane), _commands(b, lane), _clock(b, lane)
        sent = Commands(w.limited, before.last_1, before.last_2, before.last_3)
        observation, seen, generator = control_unit_step(
            w.angle,
            w.torque,
            w.motor_torque,
            sent,
            w.speed,
            switches.admittance,
            _seen(b, lane),
            _generator(b, lane),
            clock.last_reference,
            _observer(b, lane),
            reference_of(b, lane),
            _track(b, lane),
            PERIOD,
        )
        _store_seen(b, lane, seen)
        _store_generator(b, lane, generator)
        _store_commands(b, lane, sent)
        _store_clock(b, lane, Clock(w.period + 1.0, w.speed, observation.reference))
        store_observation(b, lane, observation)

    drive_lane, see_lane = scalar(named(drive, *switches)), scalar(named(see, *switches))

    def period(b: Any, lines: Any, table: Any, car_table: Any) -> None:
        for lane in range(WIDTH):
            if b[SPEED_RATE, lane] != 0.0:
                _accelerate(lane, b, table, car_table)
        for lane in range(WIDTH):
            _command(lane, b)
        for lane in range(WIDTH):
            k, dead_time = int(b[K, lane]), int(b[DEAD_TIME, lane])
            b[TARGET, lane] = through(0, k, b[LIMITED, lane], dead_time, lines[:, :, lane])
        _move_hands(b[KIND, 0], b)
        for lane in range(WIDTH):
            drive_lane(lane, b)
        for lane in range(WIDTH):
            k, late, here = int(b[K, lane]), int(b[ANGLE_DELAY, lane]), lines[:, :, lane]
            b[ANGLE, lane] = through(1, k, b[ANGLE, lane], late, here)
            b[TORQUE, lane] = through(2, k, b[TORQUE, lane], int(b[TORQUE_DELAY, lane]), here)
            b[MOTOR_TORQUE, lane] = through(3, k, b[MOTOR_TORQUE, lane], late, here)
        for lane in range(WIDTH):
            see_lane(lane, b)

    return scalar(named(period, *switches))
