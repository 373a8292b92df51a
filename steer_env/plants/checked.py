"""Checks of tables read from a file (TOML, JSON): every key known, every number in range.

A faulty table raises one ``InputError`` that names the file and the key, says what is wrong, and
how to mend it.
"""

import difflib
import json
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from steer_env.errors import InputError


def check_keys(table: object, required: Collection[str], optional: Collection[str], where: str) -> Mapping[str, Any]:
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
        raise InputError(
            place,
            f"a number is expected, not {_kind_of(value)}",
            "write a plain number in SI units",
        )
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
    if not isinstance(value, str):
        what = f"a text is expected, not {_kind_of(value)}"
        raise InputError(place, what, "write it in quotation marks")
    if not value.strip():
        raise InputError(place, "the text is empty", "write something that says what it is")
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
            f"write {known}, or install the version of steer-env that wrote the file",
        )


def read_utf8(path: Path, limit_bytes: int) -> str:
    """Return the text of a file, refusing one that is absent, empty, too large, or not UTF-8."""
    where = str(path)
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError(where, "this is a folder, a file is expected", "give the path of the file")
        if size > limit_bytes:
            raise InputError(
                where,
                f"the file has {size} bytes; such a file has at most {limit_bytes}",
                "check that this is the right file",
            )
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            where,
            f"byte {error.start} is not UTF-8 text",
            "save the file as UTF-8, or check that it is the right file",
        ) from error
    except OSError as error:
        raise InputError(where, f"the file cannot be read ({error.strerror})", "check the path") from error
    if not content.strip():
        raise InputError(where, "the file is empty", "write it again; it may have been cut off")
    return content


def read_json(path: Path, limit_bytes: int) -> dict[str, Any]:
    """Return the table in a JSON file; a key that stands twice, NaN and Infinity are refused."""
    where = str(path)
    content = read_utf8(path, limit_bytes)

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        for key in keys:
            if keys.count(key) > 1:
                raise InputError(
                    f"{where}: key '{key}'",
                    "this key stands twice in one table",
                    "remove one of them",
                )
        return dict(pairs)

    def not_a_number(word: str) -> float:
        raise InputError(where, f"{word} is not a number that JSON knows", "write finite numbers only")

    try:
        table = json.loads(content, object_pairs_hook=unique, parse_constant=not_a_number)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{where}: line {error.lineno}, column {error.colno}",
            f"this is not valid JSON ({error.msg})",
            "correct the line, or write the file again if it was cut off",
        ) from error
    except RecursionError as error:
        raise InputError(where, "the brackets are nested too deeply", "check that this is the right file") from error
    except ValueError as error:  # Python refuses whole numbers of more than 4300 digits
        raise InputError(where, f"a number is too long ({error})", "write it as 1.0e3") from error
    if not isinstance(table, dict):
        raise InputError(where, "a table { ... } is expected", "check that this is the right file")
    return table


def suggestion(word: str, known: Collection[str]) -> str:
    """Return the mend for an unknown word: the nearest known one, or the list of them."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if near:
        return f"write '{near[0]}' if that is meant"
    return f"use one of {listed(known)}" if known else "remove it"


def listed(words: Collection[str]) -> str:
    """Return the words as one comma-separated text."""
    return ", ".join(words)


def _kind_of(value: object) -> str:
    names: dict[type, str] = {str: "a text", bool: "true/false", list: "a list", dict: "a table"}
    if value is None:
        return "nothing"
    return names.get(type(value), f"the {type(value).__name__} {value!r}"[:60])
