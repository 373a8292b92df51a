"""How physics becomes machine code, in one place.

``@scalar`` marks an equation: called from Python it is the plain function one reads, called from
compiled code it is inlined. ``@compiled`` marks one of the few entry points. No fast-math anywhere
and products instead of powers, so that Python and machine code give the same bits.

Numba's own disk cache does not notice that an equation in another file changed. Ours cannot go
stale: an entry point is stored in a folder named by a hash of every source file of steer_env and of
the package it stands in, of numba's version and of the interpreter. Set STEER_ENV_CACHE=0 to
compile anew in every process, or NUMBA_DISABLE_JIT=1 to run everything as plain Python.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar

import numba
from numba.extending import register_jitable
from platformdirs import user_cache_dir

F = TypeVar("F", bound=Callable[..., Any])

_CONFIG: Any = numba.config
COMPILED = not _CONFIG.DISABLE_JIT
_ROOT = Path(__file__).resolve().parents[2]


_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True}


def scalar(function: F) -> F:
    """A scalar equation: plain Python from Python, inlined in compiled callers."""
    # Inlined early: what is still a call when the compiler looks for loops to turn into vector code keeps them scalar.
    return register_jitable(forceinline=True, **_OPTIONS)(function)


def seldom(function: F) -> F:
    """As ``scalar``, for what most periods pass by: called, which compiles faster."""
    return register_jitable(**_OPTIONS)(function)


def named(function: F, *parts: Any) -> F:
    """A function that closes over ``parts``, under a name of its own.

    Machine code from the disk cache is linked by name, and numba tells closures of one name apart by
    a count that starts anew in every process: code cached by two processes would call the wrong one.
    """
    function.__qualname__ += "".join(f"_{getattr(part, '__qualname__', part)}" for part in parts)
    return function


def compiled(function: F) -> F:
    """A compiled entry point, cached on disk under a key that follows the sources it is made of."""
    return compiled_with(function)


def compiled_with(function: F, *parts: Callable[..., Any]) -> F:
    """As ``compiled``, for an entry point that closes over functions of other packages.

    What these close over themselves (a law around another law) counts too.
    """
    dispatcher: Any = numba.njit(error_model="numpy", fastmath=False, nogil=True)(function)
    if _CONFIG.DISABLE_JIT or os.environ.get("STEER_ENV_CACHE") == "0":
        return dispatcher
    before = _CONFIG.CACHE_DIR
    _CONFIG.CACHE_DIR = str(_cache_folder((function, *parts)))
    try:
        dispatcher.enable_caching()
    finally:
        _CONFIG.CACHE_DIR = before
    return dispatcher


def _cache_folder(functions: tuple[Callable[..., Any], ...]) -> Path:
    """The cache folder of exactly these sources: steer_env and whatever the functions come from."""
    roots = {_ROOT / "steer_env"}
    waiting = list(functions)
    for function in waiting:
        cells = (cell.cell_contents for cell in function.__closure__ or ())
        waiting += [content for content in cells if isinstance(content, FunctionType) and content not in waiting]
        source = Path(function.__code__.co_filename).resolve()
        ours = source.is_relative_to(_ROOT)
        roots.add(_ROOT / source.relative_to(_ROOT).parts[0] if ours else source)
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for root in sorted(roots):
        digest.update(_hash_of(root))
    return Path(user_cache_dir("steer-env")) / "compiled" / digest.hexdigest()[:16]


@cache
def _hash_of(root: Path) -> bytes:
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
        digest.update(path.read_bytes())
    return digest.digest()
