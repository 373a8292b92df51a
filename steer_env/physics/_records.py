"""How compiled code reads and writes a NamedTuple of floats in an array: one load or store for each field, no call.

The Python functions that do the same are told to the compiler here as operations of its own. As functions to compile
they would be a third of all functions of a control period, and of the wait before the first step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import lower_builtin, type_callable

Address = Callable[[Any, Any, Any, Sequence[Any], int], Any]
"""(context, builder, type of the array, arguments, field) -> where the field lies."""


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


def reads(
    function: Callable[..., Any], record: Any, start: int, address: Address, fixed: Sequence[float | None] = ()
) -> None:
    """Compile ``function(array, ...)`` to reading the record from ``start`` on; ``fixed`` values are not read."""
    result = types.NamedUniTuple(types.float64, len(record._fields), record)
    constants = list(fixed) or [None] * len(record._fields)

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
        return context.make_tuple(builder, result, values)


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
        for k, value in enumerate(cgutils.unpack_tuple(builder, arguments[-1])):
            as_float = context.cast(builder, value, list(signature.args[-1])[k], types.float64)
            builder.store(as_float, address(context, builder, signature.args[0], given, start + k))
        return context.get_dummy_value()


def _with_index(context: Any, builder: Any, signature: Any, arguments: Sequence[Any]) -> Sequence[Any]:
    """The arguments with a lane as a machine word."""
    if len(arguments) < 2 or not isinstance(signature.args[1], types.Integer):
        return arguments
    return [arguments[0], context.cast(builder, arguments[1], signature.args[1], types.intp)]
