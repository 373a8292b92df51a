"""Run files as columns of numbers: .csv, .parquet and .mf4, chosen by the file ending.

A file is opened (its header is read), then the wanted columns are loaded; other columns may hold
anything. Files above ``LIMIT_BYTES`` are refused before they are read.
"""

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from identification.campaign_csv import read_csv
from identification.channels import FloatArray
from steer_env.errors import InputError
from steer_env.plants import checked

LIMIT_BYTES = 1_000_000_000  # about 10^7 rows of ten channels as text: an hour at 2 kHz


class Table(NamedTuple):
    """An open run file: its column names, and a function that loads some of them, each [n]."""

    where: str
    header: list[str]
    load: Callable[[Sequence[str]], dict[str, FloatArray]]
    row: Callable[[int], str]  # sample index -> the place to name in a message


def open_table(path: Path) -> Table:
    """Open a run file of any known format."""
    where = str(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            where,
            f"a run file cannot end in '{path.suffix}'",
            f"use one of {checked.listed(_READERS)}",
        )
    try:
        if path.is_dir():
            raise InputError(where, "this is a folder", "name the file in it in campaign.toml")
        if not path.is_file():
            raise InputError(where, "this run file does not exist", _neighbour(path))
        size = path.stat().st_size
        if size > LIMIT_BYTES:
            raise InputError(
                where,
                f"the file has {size / 1e9:.1f} GB; at most {LIMIT_BYTES / 1e9:g} GB are read",
                "split it into one file per manoeuvre, or log at a lower rate (100 Hz is enough)",
            )
        if size == 0:
            raise InputError(where, "the file is empty", "export the run again")
        return reader(path)
    except OSError as error:
        raise InputError(
            where, f"the file cannot be read ({error})", "check the file and its permissions"
        ) from error


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _neighbour(path: Path) -> str:
    present = sorted(p.name for p in path.parent.glob("*")) if path.parent.is_dir() else []
    if not present:
        return "put the file there, or correct the key 'file' in campaign.toml"
    return f"{checked.suggestion(path.name, present)[:300]} (key 'file' in campaign.toml)"


def _open_csv(path: Path) -> Table:
    csv = read_csv(path)
    return Table(str(path), csv.header, csv.load, lambda index: f"{path}: line {index + 2}")


def _open_parquet(path: Path) -> Table:
    where = str(path)
    pyarrow = _extra("pyarrow", where)
    parquet = _extra("pyarrow.parquet", where)
    try:
        header = list(parquet.read_schema(path).names)
    except (pyarrow.ArrowException, OSError) as error:
        raise InputError(
            where, f"this is not a readable parquet file ({error})", "export the run again"
        ) from error

    def load(names: Sequence[str]) -> dict[str, FloatArray]:
        try:
            table = parquet.read_table(path, columns=list(names))
        except (pyarrow.ArrowException, OSError) as error:
            raise InputError(
                where, f"the file is damaged ({error})", "export the run again"
            ) from error
        return {name: _as_float(table[name].to_numpy(), name, where) for name in names}

    return Table(where, header, load, lambda index: f"{path}: row {index + 1}")


def _open_mf4(path: Path) -> Table:
    where = str(path)
    asammdf = _extra("asammdf", where)
    try:
        with asammdf.MDF(path) as mdf:
            header = list(dict.fromkeys(mdf.channels_db))
    except (asammdf.blocks.utils.MdfException, OSError, ValueError, KeyError) as error:
        raise InputError(
            where, f"this is not a readable MDF file ({error})", "export the run again"
        ) from error
    # The time of the samples goes by the name "time" unless the file has a channel of our name.
    columns = header if "time_s" in header else [*header, "time_s"]

    def load(names: Sequence[str]) -> dict[str, FloatArray]:
        with asammdf.MDF(path) as mdf:
            return _mf4_columns(mdf, names, header, where)

    return Table(where, columns, load, lambda index: f"{path}: sample {index + 1}")


def _mf4_columns(
    mdf: Any, names: Sequence[str], header: Sequence[str], where: str
) -> dict[str, FloatArray]:
    columns: dict[str, FloatArray] = {}
    stamps: FloatArray | None = None
    for name in (n for n in names if n in header):
        group, index = mdf.channels_db[name][0]
        signal = mdf.get(name, group=group, index=index)
        columns[name] = _as_float(signal.samples, name, where)
        if stamps is not None and not np.array_equal(stamps, signal.timestamps):
            raise InputError(
                f"{where}: channel '{name}'",
                "it was sampled at other times than the channels before it",
                "export the run on one raster (asammdf: Resample), then try again",
            )
        stamps = signal.timestamps
    if "time_s" in names and "time_s" not in columns and stamps is not None:
        columns["time_s"] = np.asarray(stamps, float)
    return columns


def _as_float(values: Any, name: str, where: str) -> FloatArray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{where}: column '{name}'",
            "it holds something other than numbers",
            "export the channel as physical values",
        ) from error


def _extra(module: str, where: str) -> Any:
    try:
        return __import__(module, fromlist=["_"])
    except ImportError as error:
        raise InputError(
            where,
            f"reading this format needs the package {module.partition('.')[0]}, not installed here",
            "install it with: pip install 'steer-env[formats]', or export the run as .csv",
        ) from error


_READERS: dict[str, Callable[[Path], Table]] = {
    ".csv": _open_csv,
    ".parquet": _open_parquet,
    ".mf4": _open_mf4,
}
