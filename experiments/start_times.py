"""How long a fresh process takes to its first step, as medians over processes, for ``experiments.speed``.

Python writes its bytecode where nothing else lies, so that a start is what an installed program has, even where the
surroundings forbid Python to keep bytecode: once without any (the first start of all), then with.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

START = """
import time
begin = time.perf_counter()
import steer_env
imported = time.perf_counter()
import gymnasium, numpy
env = gymnasium.make({id!r})
env.reset(seed=0)
env.step(numpy.zeros(1, numpy.float32))
print(imported - begin, time.perf_counter() - begin)
"""
NEW, EMPTY, FILLED = "nothing cached, bytecode neither", "no machine code cached", "a filled cache"


def start_times(env_id: str, repeats: int) -> dict[str, float]:
    """Seconds of fresh processes: import, and all up to the first step, for what the caches hold; NEW only once."""
    times: dict[str, list[tuple[float, float]]] = {NEW: [], EMPTY: [], FILLED: []}
    with TemporaryDirectory() as folder:
        machine_code, bytecode = Path(folder) / "cache", Path(folder) / "bytecode"
        where = {**os.environ, **dict.fromkeys(("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"), str(machine_code))}
        where["PYTHONPYCACHEPREFIX"] = str(bytecode)
        where.pop("PYTHONDONTWRITEBYTECODE", None)

        def started() -> tuple[float, float]:
            command = [sys.executable, "-c", START.format(id=env_id)]
            done = subprocess.run(command, env=where, capture_output=True, text=True, check=True, timeout=300)
            imported, stepped = (float(word) for word in done.stdout.split())
            return imported, stepped

        times[NEW].append(started())
        for _ in range(repeats):
            shutil.rmtree(machine_code)
            times[EMPTY].append(started())
            times[FILLED].append(started())
    found = {}
    for state, pairs in times.items():
        found[f"import steer_env, {state}"] = median(imported for imported, _ in pairs)
        found[f"import and first step, {state}"] = median(stepped for _, stepped in pairs)
    return found
