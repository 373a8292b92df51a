"""NamedTuples that hold NamedTuples, in rows of a float array: the state of any control law, compiled.

steer_env.physics.rows has the flat ones; a law's state (a filter in it, a law around a law) is nested.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from steer_env.physics._jit import named, scalar
from steer_env.physics.rows import Row


def size_of(record: Any) -> int:
    """How many numbers are in a nested record."""
    return sum(map(size_of, record)) if isinstance(record, tuple) else 1


def numbers_in(record: Any) -> list[float]:
    """Those numbers, in order."""
    if not isinstance(record, tuple):
        return [float(record)]
    return [number for value in record for number in numbers_in(value)]


def nested_loader(record: Any, start: int = 0) -> Callable[[Row], Any]:
    """A function row -> record of the same shape as ``record`` that reads it from row[start:]."""
    if not isinstance(record, tuple):

        def number(row: Row) -> Any:
            return row[start]

        return scalar(named(number, start))
    fields = _fields_loader(record, start)
    kind: Any = type(record)

    def load(row: Row) -> Any:
        return kind(*fields(row))

    return scalar(named(load, kind, start))


def nested_storer(record: Any, start: int = 0) -> Callable[[Row, Any], None]:
    """A function (row, record) that writes it to row[start:]."""
    if not isinstance(record, tuple):

        def number(row: Row, value: Any) -> None:
            row[start] = value

        return scalar(named(number, start))
    return _fields_storer(record, 0, start, start)


def _fields_loader(values: Any, start: int) -> Callable[[Row], Any]:
    """Row -> plain tuple of the fields, one after the other."""
    head, rest = nested_loader(values[0], start), values[1:]
    if not rest:

        def last(row: Row) -> Any:
            return (head(row),)

        return scalar(named(last, start))
    others = _fields_loader(rest, start + size_of(values[0]))

    def load(row: Row) -> Any:
        return (head(row), *others(row))

    return scalar(named(load, start, len(rest)))


def _fields_storer(record: Any, k: int, start: int, origin: int) -> Callable[[Row, Any], None]:
    """(Row, record): write field ``k`` and all that follow."""
    store_one = nested_storer(record[k], start)
    if k + 1 == len(record):

        def last(row: Row, values: Any) -> None:
            store_one(row, values[k])

        return scalar(named(last, type(record), origin, k))
    store_others = _fields_storer(record, k + 1, start + size_of(record[k]), origin)

    def store(row: Row, values: Any) -> None:
        store_one(row, values[k])
        store_others(row, values)

    return scalar(named(store, type(record), origin, k))
