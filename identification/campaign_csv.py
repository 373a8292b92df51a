"""Comma-separated run files: one header line, then one line of numbers per sample.

The fast path hands the bytes to ``numpy.loadtxt`` (10^6 rows of ten columns in about two seconds).
Only when that fails is the text searched line by line for the fault to name.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.channels import FloatArray
from steer_env.errors import InputError
from steer_env.plants.checked import listed

_COMMA, _LINE_FEED = ord(","), ord("\n")


class CsvFile:
    """The bytes of a checked CSV file, with Unix line ends and no quotation marks."""

    def __init__(self, where: str, header: list[str], body: bytes) -> None:
        self.where = where
        self.header = header
        self._body = body

    def load(self, names: Sequence[str]) -> dict[str, FloatArray]:
        """Return the named columns, each [n]."""
        columns = [self.header.index(name) for name in names]
        try:
            values = np.loadtxt(
                io.BytesIO(self._body),
                delimiter=",",
                usecols=columns,
                comments=None,
                ndmin=2,
                encoding="utf-8",
            )
        except (ValueError, UnicodeDecodeError) as error:
            raise self._fault(columns) from error
        return {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}

    def _fault(self, columns: Sequence[int]) -> InputError:
        """Find the first cell that is not a number."""
        for number, line in enumerate(self._body.split(b"\n"), start=2):
            cells = line.split(b",")
            for column in columns:
                cell = cells[column].decode("utf-8", "replace").strip() if line else "0"
                if not _is_number(cell):
                    what = f"'{cell[:40]}' is not a number" if cell else "the cell is empty"
                    return InputError(
                        f"{self.where}: line {number}: column '{self.header[column]}'",
                        what,
                        "write a number with a decimal point, or remove the incomplete samples at "
                        "the start or end of the run",
                    )
        return InputError(self.where, "the numbers cannot be read", "export the run again")


def read_csv(path: Path) -> CsvFile:
    """Read a CSV file and check that it is text, has a header, and equally long lines."""
    where = str(path)
    data = path.read_bytes().removeprefix(b"\xef\xbb\xbf")  # the mark of UTF-8 that Excel writes
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError(where, "the file is UTF-16 text", "save it as UTF-8")
    if b"\0" in data:
        raise InputError(
            where,
            "the file is binary, not CSV text",
            "export the run as CSV, or correct the ending",
        )
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").rstrip(b"\n") + b"\n"
    first, _, body = data.partition(b"\n")
    header = _read_header(first, where)
    if not body.strip():
        raise InputError(where, "there is a header but not one sample", "export the run again")
    if b'"' in body:
        body = body.replace(b'"', b"")
    _refuse_ragged(body, len(header), where)
    return CsvFile(where, header, body)


def _read_header(line: bytes, where: str) -> list[str]:
    place = f"{where}: line 1"
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(place, "the header is not UTF-8 text", "save the file as UTF-8") from error
    header = [name.strip() for name in next(csv.reader([text]), [])]
    for separator, word in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in text:
            raise InputError(
                place,
                f"the columns are separated by {word}",
                "export with commas, and with decimal points",
            )
    if not any(header):
        raise InputError(place, "there is no header", "the first line must name the columns")
    if all(_is_number(name) for name in header):
        raise InputError(
            place, "there are numbers where the header is expected", "name the columns in line 1"
        )
    doubled = sorted({name for name in header if name and header.count(name) > 1})
    if doubled:
        raise InputError(
            f"{place}: column '{doubled[0]}'",
            f"more than one column has the same name ({listed(doubled)})",
            "rename or remove one",
        )
    return header


def _refuse_ragged(body: bytes, columns: int, where: str) -> None:
    """Refuse a line with more or fewer cells than the header."""
    text = np.frombuffer(body, np.uint8)
    ends = np.flatnonzero(text == _LINE_FEED)
    commas = np.flatnonzero(text == _COMMA)
    cells = np.diff(np.searchsorted(commas, ends), prepend=0) + 1
    lengths = np.diff(ends, prepend=-1) - 1
    bad = np.flatnonzero((cells != columns) | (lengths == 0))
    if bad.size:
        last = bad[0] == len(ends) - 1
        raise InputError(
            f"{where}: line {bad[0] + 2}",
            "the line is blank"
            if lengths[bad[0]] == 0
            else f"{cells[bad[0]]} cells, but the header names {columns} columns",
            "the file was cut off: remove the last line or export again"
            if last
            else "repair or remove the line",
        )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # Python reads 1_000, a measurement file does not mean it
