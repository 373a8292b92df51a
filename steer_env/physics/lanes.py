"""NamedTuples in lanes of a block: many environments side by side, so that compiled loops over them are vector code.

A block is a contiguous array [n_fields, WIDTH]: field k of the record of lane n lies at [k, n]. ``lane_loader`` and
``lane_storer`` make the functions that read and write one record of one lane, plain Python from Python. Compiled, they
address the block with offsets that are constants, from which the compiler sees that fields never overlap; through
ordinary array indexing it cannot, and keeps loops scalar.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from steer_env.physics._records import lane_address, reads, writes

WIDTH = 32  # environments side by side: a few vectors of a processor, and a block that stays in its nearest caches
_ADDRESS = lane_address(WIDTH)


def lane_loader(record: Any, start: int, fixed: Mapping[str, float] | None = None) -> Callable[[Any, int], Any]:
    """A function (block, lane) -> record that reads the record's fields from rows ``start`` and up.

    ``fixed`` fields are not read: they are these constants, and compiled code drops what they switch off.
    """
    constants = [(fixed or {}).get(name) for name in record._fields]

    def load(block: Any, lane: int) -> Any:
        given = enumerate(constants)
        return record(*(float(block[start + k, lane]) if value is None else value for k, value in given))

    reads(load, record, start, _ADDRESS, constants)
    return load


def lane_storer(record: Any, start: int) -> Callable[[Any, int, Any], None]:
    """A function (block, lane, record) that writes the record's fields to rows ``start`` and up."""

    def store(block: Any, lane: int, values: Any) -> None:
        for k, value in enumerate(values):
            block[start + k, lane] = value

    writes(store, start, _ADDRESS)
    return store
