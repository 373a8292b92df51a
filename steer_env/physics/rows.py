"""NamedTuples in rows of a float array: how states and parameters live between compiled calls.

A row of a batch array holds several NamedTuples one after the other. ``loader(T, start)`` and
``storer(T, start)`` make the two functions that read and write one of them; both are plain Python
from Python and inlined in compiled code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from steer_env.physics._jit import named, scalar, when_compiling

Row = NDArray[np.float64]


def loader(record: Any, start: int) -> Callable[[Row], Any]:
    """A function row -> record that reads the record's fields from row[start:]."""
    end = start + len(record._fields)

    def load(row: Row) -> Any:
        return record(*row[start:end].tolist())

    def tell() -> None:
        from steer_env.physics import _records

        _records.reads(load, _records.type_of(record), start, _records.row_address)

    when_compiling(tell)
    return named(load, record, start)


def storer(record: Any, start: int) -> Callable[[Row, Any], None]:
    """A function (row, record) that writes the record's fields to row[start:]."""
    end = start + len(record._fields)

    def store(row: Row, values: Any) -> None:
        row[start:end] = values

    def tell() -> None:
        from steer_env.physics import _records

        _records.writes(store, start, _records.row_address)

    when_compiling(tell)
    return named(store, record, start)


@scalar
def place(x: float, table: Any) -> tuple[int, int, float]:
    """(Row below, row above, share of the way between) of x in the ascending first column; held beyond its ends."""
    last = table.shape[0] - 1
    low = 0
    while low < last - 1 and table[low + 1, 0] <= x:
        low += 1
    high = min(low + 1, last)
    span = table[high, 0] - table[low, 0]
    share = 0.0 if span <= 0.0 else min(max((x - table[low, 0]) / span, 0.0), 1.0)
    return low, high, share


class Layout:
    """Which NamedTuple lies where in a row: ``layout["name"]`` is a slice, ``size`` the length."""

    def __init__(self, **records: Any) -> None:
        self.records = records
        self._start: dict[str, int] = {}
        self.size = 0
        for name, record in records.items():
            self._start[name] = self.size
            self.size += len(record._fields)

    def __getitem__(self, name: str) -> slice:
        start = self._start[name]
        return slice(start, start + len(self.records[name]._fields))

    def loader(self, name: str) -> Callable[[Row], Any]:
        """The function that reads one record of a row."""
        return loader(self.records[name], self._start[name])

    def storer(self, name: str) -> Callable[[Row, Any], None]:
        """The function that writes one record of a row."""
        return storer(self.records[name], self._start[name])

    def column(self, name: str, field: str) -> int:
        """Index in the row of one field of one record."""
        return self._start[name] + int(self.records[name]._fields.index(field))

    def row(self, **records: Any) -> Row:
        """A row of all records."""
        return np.array([value for name in self.records for value in records[name]], dtype=np.float64)

    def read(self, row: Row, name: str) -> Any:
        """One record of a row, from Python."""
        return self.records[name](*row[self[name]].tolist())
