"""How compiled code reads and writes a NamedTuple of floats in an array: one load or store for each field, no call.

The Python functions that do the same are told to the compiler here as operations of its own. As functions to compile
they would be a third of all functions of a control period, and of the wait before the first step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from llvmlite import ir
from numba import typeof
from numba.core import cgutils, types
from numba.extending import lower_builtin, type_callable

from steer_env.physics.lanes import Path

Address = Callable[[Any, Any, Any, Sequence[Any], int], Any]
"""(context, builder, type of the array, arguments, field) -> where the field lies."""
Fixed = Sequence[float | None]


def type_of(record: Any) -> Any:
    """The numba type of a NamedTuple of floats."""
    return types.NamedUniTuple(types.float64, len(record._fields), record)


def shape_of(example: Any) -> Any:
    """The numba type of a NamedTuple of floats and of others like it; a TypeError where it holds something else."""
    shape = typeof(example)
    if any(kind != types.float64 for kind in _kinds(shape)):
        raise TypeError(f"{type(example).__name__} holds something else than floats")
    return shape


def row_address(context: Any, builder: Any, kind: Any, arguments: Sequence[Any], place: int) -> Any:
    """Place in a one-dimensional array, whatever its stride."""
    array = context.make_array(kind)(context, builder, arguments[0])
    stride = cgutils.unpack_tuple(builder, array.strides, 1)[0]
    start = builder.bitcast(array.data, ir.IntType(8).as_pointer())
    place_in_bytes = builder.mul(stride, ir.Constant(stride.type, place))
    return builder.bitcast(builder.gep(start, [place_in_bytes]), array.data.type)


def lane_address(width: int) -> Address:
    """Row ``place`` of a contiguous array [n, width] in the column that the second argument says."""

    def address(context: Any, builder: Any, kind: Any, arguments: Sequence[Any], place: int) -> Any:
        data = context.make_array(kind)(context, builder, arguments[0]).data
        lane = arguments[1]
        return builder.gep(data, [builder.add(lane, ir.Constant(lane.type, place * width))], inbounds=True)

    return address


def reads(function: Callable[..., Any], result: Any, start: int, address: Address, fixed: Fixed = ()) -> None:
    """Compile ``function(array, ...)`` to reading a record of numba type ``result`` from ``start`` on.

    ``fixed`` values, by their place in a flat record, are not read.
    """
    n = _leaves(result)
    constants = list(fixed) or [None] * n

    @type_callable(function)
    def _type(context: Any) -> Any:
        # numba reads the argument names
        return (lambda array, lane: result) if address is not row_address else (lambda array: result)

    @lower_builtin(function, types.Array)
    @lower_builtin(function, types.Array, types.Integer)
    def _lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given = _with_index(context, builder, signature, arguments)
        values = [
            builder.load(address(context, builder, signature.args[0], given, start + k))
            if constant is None
            else ir.Constant(ir.DoubleType(), constant)
            for k, constant in enumerate(constants)
        ]
        return _folded(context, builder, result, iter(values))


def writes(function: Callable[..., None], start: int, address: Address) -> None:
    """Compile ``function(array, ..., record)`` to writing the record from ``start`` on."""

    @type_callable(function)
    def _type(context: Any) -> Any:
        if address is row_address:
            return lambda array, values: types.void
        return lambda array, lane, values: types.void

    @lower_builtin(function, types.Array, types.BaseTuple)
    @lower_builtin(function, types.Array, types.Integer, types.BaseTuple)
    def _lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given = _with_index(context, builder, signature, arguments)
        for k, value in enumerate(_flat(context, builder, signature.args[-1], arguments[-1])):
            builder.store(value, address(context, builder, signature.args[0], given, start + k))
        return context.get_dummy_value()


def replaces(function: Callable[..., Any], paths: Sequence[Path]) -> None:
    """Compile ``function(record, part)`` to the record with the part in all the places that ``paths`` lead to."""

    @type_callable(function)
    def _type(context: Any) -> Any:
        return lambda record, part: _kind_with(record, paths, part)

    @lower_builtin(function, types.BaseTuple, types.BaseTuple)
    def _lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def replaced(kind: Any, value: Any, paths: Sequence[Path]) -> Any:
            if () in paths:
                return arguments[1]
            values = cgutils.unpack_tuple(builder, value)
            inner = [
                replaced(part, values[k], _below(paths, k)) if _below(paths, k) else values[k]
                for k, part in enumerate(kind)
            ]
            return context.make_tuple(builder, _kind_with(kind, paths, signature.args[1]), inner)

        return replaced(signature.args[0], arguments[0], paths)


def _kind_with(kind: Any, paths: Sequence[Path], part: Any) -> Any:
    """The numba type of a record of type ``kind`` with a ``part`` at the ends of the paths."""
    if () in paths:
        return part
    inner = [_kind_with(own, _below(paths, k), part) if _below(paths, k) else own for k, own in enumerate(kind)]
    return types.NamedTuple(inner, kind.instance_class)


def _below(paths: Sequence[Path], k: int) -> list[Path]:
    """Where the paths through field ``k`` go on."""
    return [path[1:] for path in paths if path and path[0] == k]


def _with_index(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Sequence[Any]:
    """The arguments with a lane as a machine word."""
    if len(arguments) < 2 or not isinstance(signature.args[1], types.Integer):
        return arguments
    return [arguments[0], context.cast(builder, arguments[1], signature.args[1], types.intp)]


def is_record(kind: Any) -> bool:
    """Whether a numba type is one of a tuple, over whose parts one can iterate."""
    return isinstance(kind, types.BaseTuple)


def _kinds(shape: Any) -> list[Any]:
    return [kind for part in shape for kind in _kinds(part)] if is_record(shape) else [shape]


def _leaves(kind: Any) -> int:
    return len(_kinds(kind))


def _folded(context: Any, builder: Any, kind: Any, values: Iterator[Any]) -> Any:
    """Values one after the other as a record, which may hold others."""
    if not is_record(kind):
        return next(values)
    return context.make_tuple(builder, kind, [_folded(context, builder, part, values) for part in kind])


def _flat(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    """The floats of a record, which may hold others, one after the other."""
    if not is_record(kind):
        return [context.cast(builder, value, kind, types.float64)]
    parts = zip(kind, cgutils.unpack_tuple(builder, value), strict=True)
    return [leaf for part, inner in parts for leaf in _flat(context, builder, part, inner)]
