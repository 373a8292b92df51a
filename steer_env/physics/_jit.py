"""How physics becomes machine code, in one place.

``@scalar`` marks an equation: called from Python it is the plain function one reads, called from
compiled code it is inlined. ``@compiled`` marks one of the few entry points. No fast-math anywhere
and products instead of powers, so that Python and machine code give the same bits.

Numba is loaded when something has to be compiled or found in its cache, not before: a mark only
notes what numba is to be told then. ``_direct`` has the entry points that need it only once.

Numba's own disk cache does not notice that an equation in another file changed. Ours cannot go
stale: an entry point is stored in a folder named by a hash of every source file of steer_env and of
the package it stands in, of numba's version and of the interpreter. Set STEER_ENV_CACHE=0 to
compile anew in every process, or NUMBA_DISABLE_JIT=1 to run everything as plain Python.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any, TypeVar

from steer_env.physics import _cache

F = TypeVar("F", bound=Callable[..., Any])

_loaded_settings: Any = getattr(sys.modules.get("numba"), "config", None)
COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0") and not getattr(_loaded_settings, "DISABLE_JIT", 0)

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "no_cpython_wrapper": True}
_untold: list[Callable[[], Any]] = []
_telling = threading.RLock()  # a thread that comes while another tells has to wait until all is told


def when_compiling(tell: Callable[[], Any]) -> None:
    """Call ``tell`` before numba compiles anything."""
    _untold.append(tell)


def tell_numba() -> None:
    """Load numba and tell it what it has to know; to be called before anything is compiled."""
    with _telling:
        while _untold:
            _untold.pop(0)()


def scalar(function: F) -> F:
    """A scalar equation: plain Python from Python, inlined in compiled callers."""
    # Inlined early: what is still a call when the compiler looks for loops to turn into vector code keeps them scalar.
    return _jitable(function, forceinline=True)


def seldom(function: F) -> F:
    """As ``scalar``, for what most periods pass by: called, which compiles faster."""
    return _jitable(function)


def _jitable(function: F, **options: Any) -> F:
    def tell() -> None:
        from numba.extending import register_jitable

        register_jitable(**options, **_OPTIONS)(function)

    when_compiling(tell)
    return function


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
    entry: Any = EntryPoint(function, parts) if COMPILED else function
    return entry


class EntryPoint:
    """A function that numba compiles, or takes from its cache, when it is first called."""

    def __init__(self, function: Callable[..., Any], parts: tuple[Callable[..., Any], ...]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self._parts = parts

    def __call__(self, *arguments: Any) -> Any:
        return self.machine_code(*arguments)

    @cached_property
    def machine_code(self) -> Any:
        """Numba's dispatcher, which compiles for the types of the arguments it gets."""
        import numba

        tell_numba()
        dispatcher = numba.njit(error_model="numpy", fastmath=False, nogil=True)(self.py_func)
        folder = _cache.folder_of((self.py_func, *self._parts))
        if folder is not None and _cache.is_writable(folder):
            config: Any = numba.config
            before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
            try:
                dispatcher.enable_caching()
            finally:
                config.CACHE_DIR = before
        return dispatcher


def _tell_entry_points() -> None:
    """Compiled code may call entry points."""
    from numba.core import types
    from numba.extending import typeof_impl

    @typeof_impl.register(EntryPoint)
    def _type_of(entry: EntryPoint, context: Any) -> Any:
        return types.Dispatcher(entry.machine_code)


when_compiling(_tell_entry_points)
