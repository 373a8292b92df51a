"""A .dbc file of this folder, by message name: one layout for both ends of the bus."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from steer_env.errors import InputError

FOLDER = Path(__file__).parent


class Dbc:
    """Messages of a file. Identifiers in it are those of node 0 where a protocol has nodes."""

    def __init__(self, database: Any) -> None:
        self.messages: dict[str, Any] = {message.name: message for message in database.messages}
        self.by_identifier: dict[int, Any] = {message.frame_id: message for message in database.messages}

    def identifier(self, message: str) -> int:
        """Identifier of a message (of node 0)."""
        return int(self.messages[message].frame_id)

    def encode(self, message: str, values: Mapping[str, float]) -> bytes:
        """Data of a message from SI values; raises cantools' EncodeError out of a signal's range."""
        data: bytes = self.messages[message].encode(dict(values), scaling=True, strict=True)
        return data

    def decode(self, message: str, data: bytes) -> dict[str, float]:
        """SI values of a message whose length was checked."""
        values: dict[str, float] = self.messages[message].decode(data, decode_choices=False)
        return values

    def length(self, message: str) -> int:
        """Bytes of a message."""
        return int(self.messages[message].length)


@cache
def dbc(name: str) -> Dbc:
    """The file ``name``.dbc of this folder."""
    try:
        import cantools
    except ImportError:
        raise InputError(f"motor {name}", "cantools is not installed", "pip install 'steer-env[rig]'") from None
    return Dbc(cantools.database.load_file(FOLDER / f"{name}.dbc", strict=True))


def dbc_of(motor: str) -> Path | None:
    """The file that describes the frames of a row of MOTORS, at node 0; None where a DBC cannot."""
    path = FOLDER / f"{'odrive_06' if motor == 'odrive' else motor}.dbc"
    return path if path.is_file() else None
