"""Machine code that a process loads without numba: same bits, never stale, never in the way."""

import gc
import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from steer_env.physics import _cache, _direct
from steer_env.physics._direct import direct
from steer_env.physics._jit import COMPILED, compiled, scalar

ROOT = Path(__file__).resolve().parents[2]
needs_machine_code = pytest.mark.skipif(not COMPILED, reason="numba is switched off")

SOURCE = """
from steer_env.physics._direct import direct
from steer_env.physics._jit import scalar

@scalar
def curve(x, k):
    return x * {factor} + abs(x) ** 1.5 / (k + 2.0)

@direct
def total(value, row, extra):
    for k in range(row.size):
        row[k] = curve(row[k] + value, k)
    return row[0] + row[row.size - 1]
"""
SCRIPT = """
import sys
import numpy as np
from curves import total
row = np.linspace(-1.0, 1.0, 7)
print(total.bound(row, None)(0.3).hex(), float(row.sum()).hex(), "numba" in sys.modules)
"""


@pytest.fixture
def here(tmp_path):
    """A folder with a module of its own and an empty cache."""
    (tmp_path / "curves.py").write_text(SOURCE.format(factor=0.7))
    return tmp_path


def started(here, **settings):
    names = ("XDG_CACHE_HOME", "LOCALAPPDATA", "HOME")
    where = {**os.environ, "STEER_ENV_CACHE": "1", "PYTHONPATH": f"{here}{os.pathsep}{ROOT}"}
    where |= dict.fromkeys(names, str(here / "cache")) | settings
    return subprocess.Popen([sys.executable, "-c", SCRIPT], env=where, text=True, stdout=subprocess.PIPE, cwd=here)


def told(process):
    """(Bits of the result, whether numba was loaded) of a process that ended well."""
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    *bits, loaded = out.split()
    return bits, loaded == "True"


def kept(here):
    return list((here / "cache").rglob("*.bin"))


@needs_machine_code
def test_what_one_process_compiled_the_next_runs_without_numba_to_the_same_bits(here):
    """Catches a start that waits for numba again, code that goes stale, and other bits than Python's."""
    python, _ = told(started(here, NUMBA_DISABLE_JIT="1"))
    assert not kept(here)
    assert told(started(here)) == (python, True)
    assert len(kept(here)) == 1
    assert told(started(here)) == (python, False)
    (here / "curves.py").write_text(SOURCE.format(factor=0.8))
    changed, loaded = told(started(here))
    assert loaded
    assert changed != python
    assert told(started(here, NUMBA_OPT="1")) == (changed, True), "another setting of the compiler is another key"
    assert told(started(here, STEER_ENV_CACHE="0")) == (changed, True)
    assert len(kept(here)) == 3


def rewritten(content, **changes):
    """The file with another head, its checksum made right."""
    head, _, code = content[32:].partition(b"\n")
    content = json.dumps(json.loads(head) | changes).encode() + b"\n" + code
    return hashlib.sha256(content).digest() + content


@needs_machine_code
def test_a_damaged_file_is_compiled_anew(here):
    """Catches a process that dies from a file cut short, from a changed byte or from a symbol that it does not have."""
    right, _ = told(started(here))
    (path,) = kept(here)
    content = path.read_bytes()
    changed = bytearray(content)
    changed[-100] ^= 1
    for damaged in (b"", content[: len(content) // 2], bytes(changed), rewritten(content, symbols=["no_such_symbol"])):
        path.write_bytes(damaged)
        assert told(started(here)) == (right, True)
        assert path.read_bytes() == content
    assert told(started(here)) == (right, False)


@needs_machine_code
def test_processes_that_compile_at_once_leave_one_whole_file(here):
    """Catches a file that one process reads while another writes it."""
    processes = [started(here) for _ in range(3)]
    (right, _), *others = [told(process) for process in processes]
    assert all(bits == right for bits, _ in others)
    folder = kept(here)[0].parent
    assert [path.suffix for path in folder.iterdir()] == [".bin"]
    assert told(started(here)) == (right, False)


@needs_machine_code
def test_where_nothing_can_be_written_all_works(here):
    """Catches a read-only home that ends the program, or sends numba beside the sources, where code goes stale."""
    (here / "cache").write_text("a file where the cache's folder should be")
    before = sorted(here.rglob("*"))
    bits, loaded = told(started(here))
    assert (bits, loaded) == told(started(here))
    assert loaded
    assert [path for path in sorted(here.rglob("*")) if "__pycache__" not in path.parts] == before
    assert not list(here.rglob("*.nbi"))


def test_reading_needs_no_permission_to_write(here, monkeypatch):
    """Catches a filled cache that many users share, read only, and that nobody can use."""
    monkeypatch.setattr(_cache, "folder_of", lambda functions: here)
    if not COMPILED:
        pytest.skip("numba is switched off")
    assert direct(_scaled).bound(np.ones(3))(2.0) == 6.0
    monkeypatch.setattr(_cache, "is_writable", lambda folder: False)
    monkeypatch.setattr(_direct, "tell_numba", lambda: pytest.fail("compiled again"))
    assert direct(_scaled).bound(np.ones(3))(2.0) == 6.0
    monkeypatch.setattr(_direct, "_host", lambda: "another processor")
    with pytest.raises(pytest.fail.Exception, match="compiled again"):
        direct(_scaled).bound(np.ones(3))


def _scaled(value, row):
    total = 0.0
    for k in range(row.size):
        row[k] *= value
        total += row[k]
    return total


@scalar
def _root(x):
    return math.sqrt(x) if x > 0.0 else math.atan(x)


def _mixed(value, matrix, single, column, nothing):
    total = value if nothing is None else 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total += _root(matrix[i, j] * column[i]) + float(single[j])
    single[0] = total
    return total


def test_arrays_of_every_shape_reach_machine_code_as_they_are():
    """Catches a mixed-up desk: other strides, another width, None between arrays, and arrays freed too early."""
    rng = np.random.default_rng(3)

    def arrays():
        block = np.random.default_rng(1).standard_normal((4, 6))
        return block[:, ::2], np.arange(3, dtype=np.float32), block[:, 1], None

    marked = direct(_mixed)
    bound = marked.bound(*arrays())
    gc.collect()
    rng.standard_normal((4, 6))  # where a freed block would lie
    expected = marked(0.25, *arrays())
    assert bound(0.25) == expected
    given = arrays()
    assert marked.bound(*given)(0.25) == expected
    assert given[1][0] == np.float32(expected)
    contiguous = [None if array is None else np.ascontiguousarray(array) for array in arrays()]
    assert marked.bound(*contiguous)(0.25) == expected


@compiled
def _tripled(value):
    return 3.0 * _root(value)


@compiled
def _later(value):
    return _root(value) + _root(_tripled(value))


def _calling(value, row):
    return _tripled(value) + row[0]


def test_parts_of_machine_code_stay_usable_by_others(monkeypatch):
    """Catches a function that was compiled only to be linked in, and then is called from Python or another function."""
    monkeypatch.setenv("STEER_ENV_CACHE", "0")
    assert direct(_calling).bound(np.full(1, 0.5))(4.0) == 6.5
    assert _tripled(4.0) == 6.0
    assert _later(4.0) == 2.0 + math.sqrt(6.0)


def _careful(value, row):
    if value < 0.0:
        raise ValueError("negative")
    return value * row[0]


@needs_machine_code
def test_a_function_that_may_raise_still_raises():
    """Catches an error that is lost because C functions have none."""
    bound = direct(_careful).bound(np.full(1, 3.0))
    assert bound(2.0) == 6.0
    with pytest.raises(ValueError, match="negative"):
        bound(-1.0)


@needs_machine_code
def test_a_numba_that_is_another_inside_is_used_in_its_ordinary_way(monkeypatch):
    """Catches a release of numba after which no environment steps."""
    from steer_env.physics import _object_code

    monkeypatch.setattr(_object_code, "cpu_target", object())
    monkeypatch.setenv("STEER_ENV_CACHE", "0")
    assert direct(_scaled).bound(np.ones(3))(2.0) == 6.0


def test_a_change_of_any_source_is_another_folder(tmp_path):
    """Catches machine code that outlives the equation that it was made of, in whichever file."""
    shutil.copytree(ROOT / "steer_env", tmp_path / "steer_env", ignore=shutil.ignore_patterns("__pycache__"))
    code = "from steer_env.physics import _cache, bench; print(_cache.folder_of((_cache.is_writable,)))"
    where = {**os.environ, "PYTHONPATH": str(tmp_path), "STEER_ENV_CACHE": "1"}

    def folder():
        command = [sys.executable, "-P", "-c", code]
        return subprocess.run(command, env=where, cwd=tmp_path, capture_output=True, text=True, check=True).stdout

    seen = [folder()]
    assert folder() == seen[0]
    for name in ("physics/friction.py", "envs/cell.py", "manoeuvres/release.py", "physics/effects/drive_effects.py"):
        with (tmp_path / "steer_env" / name).open("a") as file:
            file.write("\n# changed\n")
        seen.append(folder())
    assert len(set(seen)) == len(seen)
