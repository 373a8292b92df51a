"""Numba's part of ``_direct``: a function compiled to object code with an entry that C conventions can call."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir
from numba import typeof
from numba.core import compiler, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.np import arrayobj

from steer_env.physics._direct import ObjectCode

_WORD = ir.IntType(64)
_OPTIONS = {"nopython": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_NEVER = "abort"  # called where the function raises; optimised away where it cannot
_CALLED_FROM_PYTHON = "_ZN7cpython"  # how numba begins the names of its wrappers
_LIBRARY_CALLS = {*dir(math), "fabs", "memcpy", "memmove", "memset"}


class _Library(JITCodeLibrary):
    """Code from which nothing is called but the entry of its name: the optimiser may do with all else as it likes."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.name != self.name:
                function.linkage = "internal"
        super()._optimize_final_module()


class _Part(JITCodeLibrary):
    """Code that is only linked into other code: nobody needs machine code of it alone."""

    def _finalize_final_module(self) -> None:
        if any(function.name.startswith(_CALLED_FROM_PYTHON) for function in self.get_defined_functions()):
            super()._finalize_final_module()
        else:
            self._finalize_dynamic_globals()
            self._finalized = True


@contextmanager
def _parts_without_machine_code(codegen: Any) -> Iterator[None]:
    """Every function that is called is a library of numba's, for which it makes machine code, a fifth of the wait."""
    plain = codegen.set_env

    def set_env(name: str, env: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            plain(name, env)

    codegen._library_class, codegen.set_env = _Part, set_env
    try:
        yield
    finally:
        del codegen._library_class, codegen.set_env


@global_compiler_lock
def compiled(function: Callable[..., float], arrays: tuple[Any, ...], entry: str) -> tuple[int, ObjectCode]:
    """(Address, object code) of ``entry``(desk, value), which calls ``function`` with the arrays on the desk."""
    kinds = [types.float64, *(typeof(array) for array in arrays)]
    flags: Any = compiler.Flags()
    cpu_target.options.parse_as_flags(flags, _OPTIONS)
    flags.no_compile = True  # not before the entry is there
    context = cpu_target.target_context
    library = _Library(context.codegen(), entry)
    library.enable_object_caching()
    with _parts_without_machine_code(context.codegen()):
        result = compiler.compile_extra(
            cpu_target.typing_context, context, function, tuple(kinds), types.float64, flags, {}, library=library
        )
    library.add_ir_module(_entry(context, library, result.fndesc, kinds, entry))
    address = library.get_pointer_to_function(entry)
    module = library.get_function(entry).module
    values = [*module.functions, *module.global_variables]
    outside = [value.name for value in values if value.is_declaration]
    if _NEVER in outside:
        raise TypeError(f"{function.__qualname__} may raise, which a function called as in C must not")
    _, _, (code, _) = library.serialize_using_object_code()
    return address, ObjectCode(code, entry, sorted({_symbol(name, code) for name in outside} - {""}))


def _entry(context: Any, library: Any, description: Any, kinds: list[Any], name: str) -> Any:
    """The module of a function double name(intp *desk, double value)."""
    module = library.create_ir_module(name)
    convention = context.call_conv
    native = ir.Function(
        module, convention.get_function_type(description.restype, description.argtypes), description.llvm_func_name
    )
    function = ir.Function(module, ir.FunctionType(ir.DoubleType(), [_WORD.as_pointer(), ir.DoubleType()]), name)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    desk, value = function.args
    place = 0

    def words(n: int) -> list[Any]:
        nonlocal place
        place += n
        return [builder.load(builder.gep(desk, [_WORD(k)])) for k in range(place - n, place)]

    arguments = [value]
    for kind in kinds[1:]:
        if isinstance(kind, types.NoneType):
            arguments.append(context.get_dummy_value())
            continue
        array = context.make_array(kind)(context, builder)
        (address,), shape, strides = words(1), words(kind.ndim), words(kind.ndim)
        data = builder.inttoptr(address, array.data.type)
        size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        arrayobj.populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
        arguments.append(array._getvalue())
    status, returned = convention.call_function(builder, native, description.restype, description.argtypes, arguments)
    with builder.if_then(status.is_error, likely=False):
        builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), _NEVER), [])
    builder.ret(returned)
    return module


def _symbol(name: str, code: bytes) -> str:
    """What has to be there at run time for a name that LLVM knows: an operation of its own may have become a call."""
    if not name.startswith("llvm."):
        return name
    operation = name.split(".")[1]
    return operation if operation in _LIBRARY_CALLS and operation.encode() in code else ""
