"""The limit: the same period of the environments in C, beside the compiled Python, on the same block of lanes.

Both run whole episodes of 32 environments with everything in them (motor, plant, sensors with noise, observer, both
generators, driver, reward, sums) around a proportional law. ``check`` compares what they come to.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.scored_lanes import Shape, lanes_rollout_of
from steer_env.envs.blocks import new_blocks, start_lane
from steer_env.envs.lanes import BENCH, BENCH_ROWS, BLOCK_SIZE, PARAMETER_ROWS, STATE_ROWS, Switches, switches_of
from steer_env.envs.lanes_rollout import Score
from steer_env.envs.layout import PARAMETERS, PERIOD, STATE, SUBSTEPS
from steer_env.envs.task import Task, prepare
from steer_env.physics._jit import scalar
from steer_env.physics.control_unit import Observation
from steer_env.physics.lanes import WIDTH

Array = NDArray[np.float64]
SOURCE = Path(__file__).with_suffix(".c")
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno", "-fno-trapping-math")
NO_FUSING = "-ffp-contract=off"  # what equal bits everywhere cost: a product and its sum round once each
CAPACITY = 256  # periods of noise, taken again and again
GAIN = -0.01
TASK = Task(randomise=("plant", "car", "driver", "manoeuvre"))


class Gain(NamedTuple):
    """Motor torque per torque error."""

    gain: float


class Nothing(NamedTuple):
    """State of a law without memory."""

    unused: float = 0.0


@scalar
def proportional(o: Observation, x: Nothing, p: Gain) -> tuple[float, Nothing]:
    """The cheapest law that closes the loop."""
    return p.gain * (o.reference - o.torsion_bar_torque), x


class Proportional:
    """The law as a controller."""

    parameters = Gain(GAIN)
    law = staticmethod(proportional)

    def reset(self, period: float) -> None:
        """Nothing is kept."""

    def state(self) -> Nothing:
        """No memory."""
        return Nothing()

    def __call__(self, o: Observation) -> float:
        """Motor torque in N m."""
        return proportional(o, Nothing(), self.parameters)[0]


class Block:
    """32 different environments at rest, and noise for them."""

    def __init__(self) -> None:
        blocks, lines = new_blocks(1, BLOCK_SIZE + len(Nothing._fields))
        for lane in range(WIDTH):
            setup = prepare(TASK, np.random.default_rng(lane), PERIOD)
            start_lane(blocks, lines, lane, setup.row, setup.table, setup.car_table)
        self.setup, self.block, self.lines = setup, blocks[0], lines[0]
        self.noise = np.random.default_rng(0).standard_normal((WIDTH, CAPACITY, 2))
        self.scores = np.zeros((len(Score._fields), WIDTH))


def compiled_python() -> Callable[[Block, int], None]:
    """Run a block for up to CAPACITY periods with the kernels of the environments."""
    setup = Block().setup
    switches = switches_of(setup.row, setup.table, setup.car_table)
    assert isinstance(switches, Switches)
    rollout = lanes_rollout_of(proportional, Shape(Nothing()), switches)

    def run(b: Block, periods: int) -> None:
        tables = b.setup.table, b.setup.car_table
        rollout.run(Gain(GAIN), None, b.noise, periods, b.block, b.lines, *tables, b.scores)

    return run


def compiled_c(*flags: str) -> Callable[[Block, int], None] | None:
    """The same in C, with further flags of the compiler; None where there is none."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    with TemporaryDirectory() as folder:
        library = Path(folder) / "limit.so"
        (Path(folder) / "layout.h").write_text(header(), encoding="utf-8")
        command = [compiler, *FLAGS, *flags, "-shared", "-fPIC", f"-I{folder}", str(SOURCE), "-o", str(library), "-lm"]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        run_block: Any = ctypes.CDLL(str(library)).run_block
    run_block.restype, run_block.argtypes = None, [
        *[ctypes.c_void_p] * 3, ctypes.c_int, ctypes.c_int, ctypes.c_double, ctypes.c_void_p
    ]  # fmt: skip

    def run(b: Block, periods: int) -> None:
        arrays = (b.block.ctypes.data, b.lines.ctypes.data, b.noise.ctypes.data)
        run_block(*arrays, CAPACITY, periods, GAIN, b.scores.ctypes.data)

    return run


def header() -> str:
    """The rows of a block, as the C source names them."""
    lines = [f"#define WIDTH {WIDTH}", f"#define PERIOD {PERIOD!r}", f"#define SUBSTEPS {SUBSTEPS}"]
    for prefix, layout, rows in (("P", PARAMETERS, PARAMETER_ROWS), ("S", STATE, STATE_ROWS), ("B", BENCH, BENCH_ROWS)):
        for name, record in layout.records.items():
            for field in record._fields:
                row = rows.start + layout.column(name, field)
                lines.append(f"#define {prefix}_{name}_{field}".upper() + f" {row}")
    return "\n".join(lines).replace("#DEFINE", "#define") + "\n"


def check(python: Callable[[Block, int], None], c: Callable[[Block, int], None], periods: int = 4000) -> float:
    """Largest difference of any plant state between both, over its largest value, after ``periods``."""
    blocks = Block(), Block()
    apart, most = 0.0, np.zeros((len(STATE.records["plant"]._fields), WIDTH))
    states = slice(STATE_ROWS.start + STATE["plant"].start, STATE_ROWS.start + STATE["plant"].stop)
    for _ in range(periods // CAPACITY):
        for run, b in zip((python, c), blocks, strict=True):
            run(b, CAPACITY)
        ours, theirs = (b.block[states] for b in blocks)
        most = np.maximum(most, np.abs(ours))
        apart = max(apart, float((np.abs(ours - theirs) / (most + 1e-9)).max()))
    return apart
