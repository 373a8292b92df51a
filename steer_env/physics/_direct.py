"""Entry points whose machine code a later process loads without numba, which takes longer to load than all the rest.

``@direct`` marks a function (value, array, ..., array or None) -> float. ``f.bound(array, ...)`` is it for these
arrays: a function of the value alone, which finds addresses and shapes on a desk that is laid out once.

The object code lies in the folder of ``_cache``, in a file for each kind of arrays and each kind of processor, with a
checksum, written whole or not at all. Where it is missing, damaged or needs a symbol that this process lacks, numba
compiles anew. A function that may raise is called in numba's ordinary way: functions in C do not raise.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import sys
import threading
from collections.abc import Callable
from functools import partial, update_wrapper
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steer_env import atomic
from steer_env.physics import _cache
from steer_env.physics._jit import COMPILED, compiled, tell_numba

_C_FUNCTION = ctypes.PYFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_double)
_CHECKSUM = hashlib.sha256().digest_size
_lock = threading.Lock()
_engines: list[Any] = []  # machine code lives as long as the engine that loaded it


class ObjectCode(NamedTuple):
    """Relocatable machine code of this kind of processor, the name of its entry, the symbols that it needs."""

    code: bytes
    entry: str
    symbols: list[str]


class Bound(partial[float]):
    """A function of one float; what its machine code points to lives as long as it does."""

    keeps: Any


def direct(function: Callable[..., float]) -> DirectFunction:
    """Mark an entry point that is called over and over with the same arrays."""
    return DirectFunction(function)


class DirectFunction:
    """Called, it is the Python function."""

    def __init__(self, function: Callable[..., float]) -> None:
        update_wrapper(self, function)
        self._function = function
        self._by_kinds: dict[str, Any] = {}
        self._entry_point = compiled(function)

    def __call__(self, value: float, *arrays: Any) -> float:
        return self._function(value, *arrays)

    def bound(self, *arrays: Any) -> Callable[[float], float]:
        """The function of ``value`` alone; machine code unless numba is switched off."""
        if not COMPILED:
            return lambda value: self._function(value, *arrays)
        kinds = " ".join("none" if array is None else _kind_of(array) for array in arrays)
        with _lock:
            if kinds not in self._by_kinds:
                address = self._address(kinds, arrays)
                self._by_kinds[kinds] = _C_FUNCTION(address) if address else None
        function = self._by_kinds[kinds]
        if function is None:
            return lambda value: float(self._entry_point(value, *arrays))
        desk = np.array([word for array in arrays if array is not None for word in _words_of(array)], np.intp)
        bound = Bound(function, desk.ctypes.data)
        bound.keeps = desk, arrays
        return bound

    def _address(self, kinds: str, arrays: tuple[Any, ...]) -> int:
        """Where the machine code for these kinds of arrays begins; 0 where there is none that C can call."""
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        entry = f"{name}.{hashlib.sha256(f'{_host()} {kinds}'.encode()).hexdigest()[:16]}"
        folder = _cache.folder_of((self._function,))
        if folder is not None:
            address = _loaded(folder / f"{entry}.bin")
            if address:
                return address
        tell_numba()
        try:
            from steer_env.physics._object_code import compiled as object_code

            address, result = object_code(self._function, arrays, entry)
        except (ImportError, AttributeError, TypeError):
            return 0  # it may raise, or this numba is another inside: then the ordinary way
        if folder is not None and _cache.is_writable(folder):
            _keep(result, folder / f"{entry}.bin")
        return address


def _words_of(array: Any) -> list[int]:
    """What a compiled function is told of an array: address, shape, strides in bytes."""
    return [array.ctypes.data, *array.shape, *array.strides]


def _kind_of(array: Any) -> str:
    flags = array.flags
    marks = (flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable)
    return f"{array.dtype.str}{array.ndim}" + "".join("01"[mark] for mark in marks)


def _host() -> str:
    import llvmlite.binding as llvm

    return f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


def _keep(result: ObjectCode, path: Path) -> None:
    head = json.dumps({"entry": result.entry, "symbols": result.symbols}).encode()
    content = head + b"\n" + result.code
    try:
        atomic.write_bytes(path, hashlib.sha256(content).digest() + content)
    except OSError:
        return  # a full disk: the next process compiles again


def _read(path: Path) -> ObjectCode | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    checksum, content = content[:_CHECKSUM], content[_CHECKSUM:]
    if hashlib.sha256(content).digest() != checksum:
        return None
    head, _, code = content.partition(b"\n")
    return ObjectCode(code, **json.loads(head))


def _loaded(path: Path) -> int:
    """Address of the entry of a file; 0 where there is none that this process can run."""
    import llvmlite.binding as llvm

    found = _read(path)
    if found is None:
        return 0
    # The C library that Python calls: on Windows there are several in a process, with other last bits.
    library = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    if not all(hasattr(library, name) for name in found.symbols):
        return 0
    for name in found.symbols:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(found.code))
    engine.finalize_object()
    _engines.append(engine)
    return int(engine.get_function_address(found.entry))
