"""NamedTuples in lanes of a block: many environments side by side, so that compiled loops over them are vector code.

A block is a contiguous array [n_fields, WIDTH]: field k of the record of lane n lies at [k, n]. ``lane_loader`` and
``lane_storer`` make the functions that read and write one record of one lane, plain Python from Python. Compiled, they
address the block with offsets that are constants, from which the compiler sees that fields never overlap; through
ordinary array indexing it cannot, and keeps loops scalar.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload

from steer_env.physics._jit import named, scalar

WIDTH = 32  # environments side by side: a few vectors of a processor, and a block that stays in its nearest caches


def lane_loader(record: Any, start: int, fixed: Mapping[str, float] | None = None) -> Callable[[Any, int], Any]:
    """A function (block, lane) -> record that reads the record's fields from rows ``start`` and up.

    ``fixed`` fields are not read: they are these constants, and compiled code drops what they switch off.
    """
    held = dict(fixed or {})
    constants = [held.get(name) for name in record._fields]
    parts = (record, start, *(f"{name}_{value:g}" for name, value in held.items()))
    read_compiled = _reader(start, constants)

    def read(block: Any, lane: int) -> tuple[float, ...]:
        given = enumerate(constants)
        return tuple(float(block[start + k, lane]) if value is None else value for k, value in given)

    def compiled(block: Any, lane: int) -> Any:
        return read_compiled(block, lane)

    def load(block: Any, lane: int) -> Any:
        return record(*read(block, lane))

    named(compiled, *parts)
    overload(read, strict=False, jit_options={"forceinline": True})(lambda block, lane: compiled)
    return scalar(named(load, *parts))


def lane_storer(record: Any, start: int) -> Callable[[Any, int, Any], None]:
    """A function (block, lane, record) that writes the record's fields to rows ``start`` and up."""
    write_compiled = _writer(start)

    def write(block: Any, lane: int, values: Any) -> None:
        for k, value in enumerate(values):
            block[start + k, lane] = value

    def compiled(block: Any, lane: int, values: Any) -> None:
        write_compiled(block, lane, values)

    def store(block: Any, lane: int, values: Any) -> None:
        write(block, lane, values)

    named(compiled, record, start)
    overload(write, strict=False, jit_options={"forceinline": True})(lambda block, lane, values: compiled)
    return scalar(named(store, record, start))


def _address(context: Any, builder: Any, kind: Any, block: Any, row: int, lane: Any) -> Any:
    data = context.make_array(kind)(context, builder, block).data
    return builder.gep(data, [builder.add(lane, ir.Constant(lane.type, row * WIDTH))], inbounds=True)


def _reader(start: int, constants: list[float | None]) -> Any:
    @intrinsic
    def read(typing_context: Any, block: Any, lane: Any) -> Any:
        result = types.UniTuple(types.float64, len(constants))

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = []
            for k, constant in enumerate(constants):
                if constant is None:
                    address = _address(context, builder, signature.args[0], arguments[0], start + k, arguments[1])
                    values.append(builder.load(address))
                else:
                    values.append(ir.Constant(ir.DoubleType(), constant))
            return context.make_tuple(builder, result, values)

        return result(block, types.intp), generate

    return read


def _writer(start: int) -> Any:
    @intrinsic
    def write(typing_context: Any, block: Any, lane: Any, values: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            for k, value in enumerate(cgutils.unpack_tuple(builder, arguments[2])):
                address = _address(context, builder, signature.args[0], arguments[0], start + k, arguments[1])
                builder.store(value, address)
            return context.get_dummy_value()

        return types.void(block, types.intp, values), generate

    return write
