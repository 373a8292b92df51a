"""RigEnv: the steer-by-wire environment with a real motor (or a virtual one on its bus) in the place of the plant."""

from __future__ import annotations

import gc
import math
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from steer_env.envs import batch
from steer_env.envs.layout import OBSERVATION_LIMIT, PARAMETERS, Truth
from steer_env.envs.measured_period import step_measured
from steer_env.envs.steer_env import COMPLETE, TRUTH_NAMES, UNSTABLE, scales_of
from steer_env.envs.task import Setup, Task, prepare
from steer_env.errors import InputError, RigError
from steer_env.physics.control_unit import Observation
from steer_env.physics.motor import Motor, limited_command
from steer_env.plants import Plant, Reference
from steer_env.rig.connection import Connection
from steer_env.rig.safety import State
from steer_env.rig.session import PERIOD, RigSession
from steer_env.rig.settling import settle
from steer_env.rig.shutdown import Shutdown

BRING_UP_TIMEOUT, SETTLE_TIMEOUT = 5.0, 15.0  # s


class RigEnv(gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]):
    """The spaces, info and reward of ``SteerEnv`` on a force-feedback motor. One step is 1 ms of real time.

    What a simulation knows and a rig measures: ``info``'s true torque and angle are the measured ones, the ideal
    reference is the control unit's own, the car is simulated from the measured angle. ``info["rig"]`` has what only a
    rig has (times, ages, overruns, what the safety layer did, the bus).

    ## Arming
    Two acts: ``env.unwrapped.unlock()``, with hands clear of the wheel, allows torque until something trips;
    ``reset()`` then brings the drive up, arms, and turns the wheel gently to straight ahead. After a trip both are
    needed again. The stepped virtual motor can hurt nobody and is unlocked by itself.

    ## End
    Truncated at the end of the manoeuvre, where the wheel is thrown, or at a trip; ``info["ended"]`` tells. Then, at
    ``close``, on an exception inside a ``with``, on SIGINT, SIGTERM and SIGHUP, and when the parent process is gone:
    zero torque, then the drive's state down.

    ## Options
    Those of ``Connection`` (motor, interface, channel, torque_cap, ...) and the fields of ``Task``. On a real rig the
    person is the driver and does what the manoeuvre says; ``driver`` and ``manoeuvre`` move the hand of a virtual one.
    ``rest`` are seconds after the manoeuvre that still belong to the episode.

    ## Version history
    v0: first.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (Gymnasium reads it from the class)

    def __init__(self, render_mode: str | None = None, rest: float = 0.0, **options: Any) -> None:
        if render_mode is not None:
            raise ValueError("a rig draws nothing: look at the wheel")
        self.render_mode = None
        self._rest_periods = round(rest / PERIOD)
        self.connection, others = Connection.taken_from(options)
        self.task = Task().changed({"plant": "SbW"} | others)
        n = len(Observation._fields)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = gymnasium.spaces.Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (n,), np.float32)
        self._rows = batch.new_rows(1)
        self._observation, self._scaled = np.zeros(n), np.zeros(n, np.float32)
        self._truth, self._scales = np.zeros(len(Truth._fields)), np.ones(n)
        self._setup: Setup = prepare(self.task, np.random.default_rng(0), PERIOD)
        self._period = -1
        self._unlocked = self.connection.interface == "stepped"
        self._session: RigSession | None = None
        self._shutdown = Shutdown(self._abandon)

    @property
    def plant(self) -> Plant:
        """What a controller may know of the wheel."""
        return self._setup.plant

    @property
    def reference(self) -> Reference:
        """The haptic reference at the episode's first speed."""
        return replace(self._setup.reference, speed=PARAMETERS.read(self._setup.row, "episode").speed)

    @property
    def motor(self) -> Motor:
        """The motor as the control side believes it; its rated torque scales the action."""
        motor: Motor = PARAMETERS.read(self._setup.row, "motor")
        return motor

    @property
    def observation(self) -> Observation:
        """The latest observation in SI, as controllers take it."""
        return Observation._make(self._observation.tolist())

    @property
    def session(self) -> RigSession:
        """The open rig; RuntimeError before the first reset and after close."""
        if self._session is None:
            raise RuntimeError("the rig is not open: call env.reset() first")
        return self._session

    @property
    def periods(self) -> int:
        """How many steps the episode has."""
        return self._setup.periods + self._rest_periods

    def action_for(self, torque: float) -> NDArray[np.float32]:
        """The action that asks for a motor torque in N m."""
        return np.array([torque / self.motor.rated_torque], np.float32)

    def unlock(self) -> None:
        """Do the first of the two acts that arm the rig: hands are clear, torque may come with the next reset."""
        self._unlocked = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Bring the drive up, arm, turn the wheel gently to straight ahead, and start an episode there.

        Raises:
            InputError: the rig was not unlocked, or a bus, motor or option is not there.
            RigError: the drive does not come up, or the wheel does not settle in time. The torque is zero then.
        """
        super().reset(seed=seed)
        if not self._unlocked:
            raise InputError(
                "rig", "is locked", "with hands clear of the wheel call env.unwrapped.unlock(), then reset"
            )
        if options:
            self.task = self.task.changed(options)
        self._setup = prepare(self.task, self.np_random, PERIOD)
        self._rows[0][0] = self._setup.row
        self._scales[:] = scales_of(self.task.causality, self.motor.rated_torque)
        batch.start_batch(*self._rows, self._setup.table, self._setup.car_table)
        self._compile()
        if self.connection.interface != "stepped":
            # A full collection of a program with compiled code takes tens of ms. What lives now is not looked at again.
            gc.collect()
            gc.freeze()
        self._start_drive()
        self._period = 0
        self._observation[:] = self._truth[:] = 0.0
        speed = PARAMETERS.read(self._setup.row, "episode").speed
        self._observation[Observation._fields.index("speed")] = speed
        self._truth[Truth._fields.index("speed")] = speed
        self._scaled[:] = self._observation / self._scales
        return self._scaled.copy(), self._info(clipped=False, ended="")

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One control period with a motor torque as a share of the rated torque, as far as the safety layer allows."""
        if self._period < 0:
            raise RuntimeError("no episode runs: call env.reset() first")
        session = self.session
        share = float(np.asarray(action).item())
        if not math.isfinite(share):
            self._end("the controller gave no finite torque")
            raise ValueError(
                f"action is {share}: give a finite share of the rated torque in [-1, 1]; the rig has tripped"
            )
        clipped = share < -1.0 or share > 1.0
        command = limited_command(share * self.motor.rated_torque, session.applied, self.motor, PERIOD)
        self.connection.move_hand(self._setup, (self._period + 0.5) * PERIOD)
        try:
            reading = session.cycle(command)
        except BaseException as error:
            session.stop(f"{type(error).__name__} in a control cycle")
            raise
        if self._shutdown.orphaned:
            session.stop("the parent process is gone")
        assert reading is not None, "armed without a measurement"
        measured = (session.applied, reading.angle, reading.torsion_bar_torque, reading.motor_torque)
        tables = (self._setup.table, self._setup.car_table)
        rows = (self._rows[0][0], self._rows[1][0])
        step_measured(*measured, *rows, *tables, self._scales, self._observation, self._scaled, self._truth)
        self._period += 1
        info = self._info(clipped, COMPLETE if self._period >= self.periods else "")
        if info["unstable"] > 0.5:
            session.stop(UNSTABLE)
            info["ended"] = UNSTABLE
        elif session.safety.state is not State.ARMED:
            info["ended"] = f"tripped: {session.safety.trip_reason}"
        if info["ended"]:
            self._end(info["ended"])
        reward = info["reward_tracking"] + info["reward_smoothness"] + info["reward_effort"]
        return self._scaled.copy(), reward, False, bool(info["ended"]), info

    def close(self) -> None:
        """Zero torque, the drive's state down, the bus let go of. May be called again."""
        session, self._session = self._session, None
        self._period = -1
        if session is not None:
            try:
                session.close()
            finally:
                self._shutdown.remove()

    def _start_drive(self) -> None:
        if self._session is None:
            self._session = self.connection.open(self.plant)
            self._shutdown.install()
        session = self._session
        try:
            self.connection.let_go()
            session.bring_up(BRING_UP_TIMEOUT)
            session.arm()
            settle(session, SETTLE_TIMEOUT)
        except BaseException as error:
            session.stop(f"reset did not succeed: {error}")
            session.bring_down()
            self._unlocked = self.connection.interface == "stepped"
            raise

    def _end(self, reason: str) -> None:
        """Zero torque, then the drive's state down; anything but the manoeuvre's end needs a fresh unlock."""
        if reason != COMPLETE:
            self.session.stop(reason)
            self._unlocked = self.connection.interface == "stepped"
        self._period = -1
        self.session.bring_down()

    def _abandon(self) -> None:
        """From a signal or at exit: no time for manners."""
        if self._session is not None:
            self._session.stop("the program ends")

    def _compile(self) -> None:
        """The first call compiles: not while a motor waits for its next command."""
        rows = (self._rows[0][0].copy(), self._rows[1][0].copy())
        spare: Any = (self._observation.copy(), self._scaled.copy(), self._truth.copy())
        step_measured(0.0, 0.0, 0.0, 0.0, *rows, self._setup.table, self._setup.car_table, self._scales, *spare)

    def _info(self, clipped: bool, ended: str) -> dict[str, Any]:
        info: dict[str, Any] = dict(zip(TRUTH_NAMES, self._truth.tolist(), strict=True))
        info["observation"] = self.observation
        info["clipped"] = clipped
        info["ended"] = ended
        info["rig"] = self.session.report()
        return info


__all__ = ["RigEnv", "RigError"]
