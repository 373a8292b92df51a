"""A user's own controller: NAME out of FILE.py, called as a law's ``make``."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from steer_env.errors import InputError

SEPARATOR = ".py:"
WRAPPERS = ("passivity",)  # rows that take another controller after a colon


def inner_of(name: str) -> str:
    """What stands inside of WRAPPER:NAME; nothing for any other name."""
    outer, _, inner = name.partition(":")
    return inner if outer in WRAPPERS else ""


def is_own(name: str) -> bool:
    """Whether a controller's name is FILE.py:NAME, or holds one in a wrapper."""
    return SEPARATOR in name


def file_of(name: str) -> Path:
    """The file of FILE.py:NAME, absolute; a wrapper before it does not matter."""
    inner = inner_of(name)
    return file_of(inner) if inner else Path(name.rpartition(":")[0]).expanduser().resolve()


def load_own(name: str) -> Callable[..., Any]:
    """What stands under NAME in FILE.py; InputError where file or name are missing or fail."""
    path, item = file_of(name), name.rpartition(":")[2]
    if not path.is_file():
        raise InputError(str(path), "there is no such file", "give FILE.py:NAME")
    made = getattr(_module(path, path.stat().st_mtime_ns), item, None)
    if not callable(made):
        raise InputError(
            str(path),
            f"there is nothing to call under {item!r}",
            "define make(plant, reference, causality, **gains) -> Controller under that name",
        )
    found: Callable[..., Any] = made
    return found


@cache
def _module(path: Path, changed: int) -> Any:
    spec = importlib.util.spec_from_file_location(f"own_controller_{path.stem}", path)
    assert spec is not None, path
    assert spec.loader is not None, path
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as wrong:
        raise InputError(str(path), f"it fails when read: {wrong!r}", "mend the file") from wrong
    return module
