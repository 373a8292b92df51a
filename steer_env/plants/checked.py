"""Checks of tables read from a file (TOML, JSON): every key known, every number finite and in range.

A faulty table raises one ``InputError`` that names the file and the key, says what is wrong, and how to mend it.
"""

import difflib
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from steer_env.errors import InputError


def check_keys(
    table: object, required: Collection[str], optional: Collection[str], where: str
) -> Mapping[str, Any]:
    """Return ``table`` as a mapping after refusing missing keys and keys that nobody would read."""
    if not isinstance(table, Mapping):
        raise InputError(
            where,
            f"a table of keys and values is expected here, not {_kind_of(table)}",
            f"write the keys {listed(required)}",
        )
    known = [*required, *optional]
    for key in table:
        if key not in known:
            raise InputError(f"{where}: key '{key}'", "this key is not known", suggestion(str(key), known))
    for key in required:
        if key not in table:
            raise InputError(f"{where}: key '{key}'", "this key is missing", f"add '{key}'")
    return table


def number(table: Mapping[str, Any], key: str, where: str, low: float = -math.inf, high: float = math.inf) -> float:
    """Return ``table[key]`` as a float after checking that it is a finite number in [low, high]."""
    value = table[key]
    place = f"{where}: key '{key}'"
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError(place, f"a number is expected, not {_kind_of(value)}", "write a plain number in SI units")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise InputError(place, f"{value} is not a finite number", "write a finite number")
    if not low <= result <= high:
        raise InputError(
            place,
            f"{value:g} is outside the physical range {low:g} to {high:g}",
            "check the value and its unit (the unit stands in the key)",
        )
    return result


def text(table: Mapping[str, Any], key: str, where: str, allowed: Collection[str] = ()) -> str:
    """Return ``table[key]`` as a non-empty string, one of ``allowed`` when that is given."""
    value = table[key]
    place = f"{where}: key '{key}'"
    if not isinstance(value, str) or not value.strip():
        raise InputError(place, f"a non-empty text is expected, not {_kind_of(value)}", "write it in quotation marks")
    if allowed and value not in allowed:
        raise InputError(place, f"'{value}' is not one of the choices", suggestion(value, allowed))
    return value


def schema_version(table: Mapping[str, Any], where: str, known: int) -> None:
    """Refuse a file whose ``schema_version`` this program does not read."""
    value = table["schema_version"]
    if isinstance(value, bool) or value != known:
        raise InputError(
            f"{where}: key 'schema_version'",
            f"version {value!r} is not one this program reads",
            f"write schema_version {known}, or install the version of steer-env that wrote the file",
        )


def read_utf8(path: Path, limit_bytes: int) -> str:
    """Return the text of a small file, refusing one that is absent, empty, too large, or not UTF-8."""
    where = str(path)
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError(where, "this is a folder, a file is expected", "give the path of the file")
        if size > limit_bytes:
            raise InputError(
                where,
                f"the file has {size} bytes, more than the {limit_bytes} that such a file can sensibly have",
                "check that this is the right file",
            )
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            where, f"byte {error.start} is not UTF-8 text", "save the file as UTF-8, or check that it is the right file"
        ) from error
    except OSError as error:
        raise InputError(where, f"the file cannot be read ({error.strerror})", "check the path") from error
    if not content.strip():
        raise InputError(where, "the file is empty", "write it again; it may have been cut off")
    return content


def suggestion(word: str, known: Collection[str]) -> str:
    """Return the mend for an unknown word: the nearest known one, or the list of them."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if near:
        return f"did you mean '{near[0]}'?"
    return f"use one of {listed(known)}" if known else "remove it"


def listed(words: Collection[str]) -> str:
    """Return the words as one comma-separated text."""
    return ", ".join(words)


def _kind_of(value: object) -> str:
    names: dict[type, str] = {str: "a text", bool: "true/false", list: "a list", dict: "a table"}
    if value is None:
        return "nothing"
    return names.get(type(value), f"the {type(value).__name__} {value!r}"[:60])
