"""Where machine code is kept on disk: a folder for exactly these sources, this numba and this interpreter."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any

from platformdirs import user_cache_dir

_ROOT = Path(__file__).resolve().parents[2]
_WITHOUT_EFFECT = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER")


def folder_of(functions: tuple[Callable[..., Any], ...]) -> Path | None:
    """The folder of exactly these sources: steer_env and whatever the functions come from. None: nothing is kept."""
    if os.environ.get("STEER_ENV_CACHE") == "0":
        return None
    roots = {_ROOT / "steer_env"}
    waiting = list(functions)
    for function in waiting:
        cells = (cell.cell_contents for cell in function.__closure__ or ())
        waiting += [content for content in cells if isinstance(content, FunctionType) and content not in waiting]
        source = Path(function.__code__.co_filename).resolve()
        ours = source.is_relative_to(_ROOT)
        roots.add(_ROOT / source.relative_to(_ROOT).parts[0] if ours else source)
    digest = hashlib.sha256(_compiler())
    for root in sorted(roots):
        digest.update(_hash_of(root))
    return Path(user_cache_dir("steer-env")) / "compiled" / digest.hexdigest()[:16]


def is_writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if need be.

    Numba looks for another folder where it cannot write, beside the source for one, in which code goes stale.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


@cache
def _compiler() -> bytes:
    """What machine code depends on besides sources and processor: numba's version and settings, the interpreter."""
    versions = b""
    for spec in (find_spec("numba"), find_spec("llvmlite")):
        if spec is not None and spec.origin is not None:
            versions += Path(spec.origin).with_name("_version.py").read_bytes()  # numba itself takes long to load
    names = (name for name in os.environ if name.startswith("NUMBA_") and name not in _WITHOUT_EFFECT)
    settings = [f"{name}={os.environ[name]}" for name in sorted(names)]
    return versions + repr((settings, sys.version)).encode()


@cache
def _hash_of(root: Path) -> bytes:
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
        digest.update(path.read_bytes())
    return digest.digest()
