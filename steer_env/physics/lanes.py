"""NamedTuples in lanes of a block: many environments side by side, so that compiled loops over them are vector code.

A block is a contiguous array [n_fields, WIDTH]: field k of the record of lane n lies at [k, n]. ``lane_loader`` and
``lane_storer`` make the functions that read and write one record of one lane, plain Python from Python. Compiled, they
address the block with offsets that are constants, from which the compiler sees that fields never overlap; through
ordinary array indexing it cannot, and keeps loops scalar.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from steer_env.physics._jit import named, when_compiling

Path = tuple[int, ...]
"""Field of a record, field of the record in that field, and so on."""
WIDTH = 32  # environments side by side: a few vectors of a processor, and a block that stays in its nearest caches


def lane_loader(record: Any, start: int, fixed: Mapping[str, float] | None = None) -> Callable[[Any, int], Any]:
    """A function (block, lane) -> record that reads the record's fields from rows ``start`` and up.

    ``fixed`` fields are not read: they are these constants, and compiled code drops what they switch off.
    """
    constants = [(fixed or {}).get(name) for name in record._fields]

    def load(block: Any, lane: int) -> Any:
        given = enumerate(constants)
        return record(*(float(block[start + k, lane]) if value is None else value for k, value in given))

    def tell() -> None:
        from steer_env.physics import _records

        _records.reads(load, _records.type_of(record), start, _records.lane_address(WIDTH), constants)

    when_compiling(tell)
    return named(load, record, start)


def lane_storer(record: Any, start: int) -> Callable[[Any, int, Any], None]:
    """A function (block, lane, record) that writes the record's fields to rows ``start`` and up."""

    def store(block: Any, lane: int, values: Any) -> None:
        for k, value in enumerate(values):
            block[start + k, lane] = value

    def tell() -> None:
        from steer_env.physics import _records

        _records.writes(store, start, _records.lane_address(WIDTH))

    when_compiling(tell)
    return named(store, record, start)


def lane_records(
    example: Any, start: int = 0
) -> tuple[int, Callable[[Any, int], Any], Callable[[Any, int, Any], None]]:
    """(Floats, loader, storer) of records shaped like ``example``, a NamedTuple of floats and of others like it.

    They lie in rows ``start`` and up.
    """
    from steer_env.physics import _records

    shape, address = _records.shape_of(example), _records.lane_address(WIDTH)

    def load(block: Any, lane: int) -> Any:
        values = iter(block[start:, lane].tolist())
        return _filled(example, values)

    def store(block: Any, lane: int, record: Any) -> None:
        for k, value in enumerate(flat(record)):
            block[start + k, lane] = value

    _records.reads(load, shape, start, address)
    _records.writes(store, start, address)
    return len(flat(example)), load, store


def part_replacer(paths: Sequence[Path]) -> Callable[[Any, Any], Any]:
    """A function (record, part) -> the record with the part in all the places that ``paths`` lead to."""

    def replaced(record: Any, part: Any) -> Any:
        for path in paths:
            record = _with_part(record, path, part)
        return record

    def tell() -> None:
        from steer_env.physics import _records

        _records.replaces(replaced, paths)

    when_compiling(tell)
    return named(replaced, *paths)


def _with_part(record: Any, path: Path, part: Any) -> Any:
    if not path:
        return part
    values = list(record)
    values[path[0]] = _with_part(values[path[0]], path[1:], part)
    return type(record)._make(values)


def flat(record: Any) -> list[float]:
    """The floats of a nested NamedTuple, one after the other."""
    return [leaf for value in record for leaf in (flat(value) if isinstance(value, tuple) else [float(value)])]


def _filled(example: Any, values: Iterator[float]) -> Any:
    parts = [_filled(part, values) if isinstance(part, tuple) else next(values) for part in example]
    return type(example)._make(parts) if hasattr(example, "_make") else tuple(parts)
