"""Functions that spoil one thing in the folder of the synthetic campaign."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.identification.synthetic_campaign import vehicle_run, write_csv

FIRST = "runs/060_frequency_response_1.csv"
CSV = "060_frequency_response_1.csv"
Channels = dict[str, np.ndarray]
Breaker = Callable[[Path], None]


def toml(old: str, new: str) -> Breaker:
    """Replace a text that must be in campaign.toml."""

    def apply(folder: Path) -> None:
        path = folder / "campaign.toml"
        text = path.read_text("utf-8")
        assert old in text, old
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return apply


def without_table(start: str, end: str) -> Breaker:
    """Remove the lines of campaign.toml from ``start`` to before ``end``."""

    def apply(folder: Path) -> None:
        path = folder / "campaign.toml"
        head, _, rest = path.read_text("utf-8").partition(start)
        path.write_text(head + end + rest.partition(end)[2], encoding="utf-8")

    return apply


def toml_bytes(content: bytes) -> Breaker:
    return lambda folder: write(folder / "campaign.toml", content)


def add(text: str) -> Breaker:
    """Add tables before the runs."""
    return toml("\n[[runs]]", f"\n{text}\n\n[[runs]]")


def run_bytes(change: Callable[[bytes], bytes]) -> Breaker:
    """Change the bytes of the first run's file."""
    return lambda folder: write(folder / FIRST, change((folder / FIRST).read_bytes()))


def line(number: int, change: Callable[[str], str]) -> Breaker:
    """Change one line (1 is the header) of the first run's file."""

    def apply(folder: Path) -> None:
        lines = (folder / FIRST).read_text("utf-8").splitlines()
        lines[number - 1] = change(lines[number - 1])
        (folder / FIRST).write_text("\n".join(lines) + "\n", encoding="utf-8")

    return apply


def run(change: Callable[[Channels], Channels], seconds: float = 17.5) -> Breaker:
    """Write the first run's file anew from changed channels."""
    return lambda folder: write_csv(folder / FIRST, change(vehicle_run(60.0, seconds)))


def scaled(name: str, factor: float) -> Breaker:
    return run(lambda c: {**c, name: c[name] * factor})


def swapped(one: str, other: str) -> Breaker:
    return run(lambda c: {**c, one: c[other], other: c[one]})


def at(name: str, index: int, value: float) -> Breaker:
    def change(c: Channels) -> Channels:
        c[name][index] = value
        return c

    return run(change)


def cell(column: int, text: str) -> Callable[[str], str]:
    """Replace one cell of a line."""

    def change(old: str) -> str:
        cells = old.split(",")
        cells[column] = text
        return ",".join(cells)

    return change


def renamed(old: str, new: str) -> Breaker:
    return line(1, lambda header: header.replace(old, new))


def missing_file(folder: Path) -> None:
    (folder / FIRST).unlink()


def empty_folder(folder: Path) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()


def run_is_a_folder(folder: Path) -> None:
    (folder / FIRST).unlink()
    (folder / FIRST).mkdir()


def huge_run(folder: Path) -> None:
    """A sparse file: it takes no space, but says that it has 2 GB."""
    with (folder / FIRST).open("r+b") as file:
        file.truncate(2_000_000_000)


def other_format(ending: str) -> Breaker:
    """The first run becomes a damaged file of another format."""

    def apply(folder: Path) -> None:
        write(folder / FIRST.replace(".csv", ending), b"not what the ending says" * 40)
        toml(FIRST, FIRST.replace(".csv", ending))(folder)

    return apply


def as_drive(text: str) -> Breaker:
    """A drive of the first run alone, with extra text in its campaign.toml."""
    head = 'schema_version = 1\nname = "d"\nkind = "drive"\n'
    entry = f'\n[[runs]]\nfile = "{FIRST}"\nmanoeuvre = "free"\n'
    return lambda folder: write(folder / "campaign.toml", (head + text + entry).encode())


def write(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def duplicate_run(folder: Path) -> None:
    toml("runs/060_frequency_response_2.csv", "runs/../runs/060_frequency_response_1.csv")(folder)


def jitter(c: Channels) -> Channels:
    c["time_s"] = c["time_s"] + np.random.default_rng(1).uniform(-0.006, 0.006, len(c["time_s"]))
    return c


def without(*names: str) -> Callable[[Channels], Channels]:
    return lambda c: {name: values for name, values in c.items() if name not in names}


def toml_runs(folder: Path, text: str) -> None:
    """Replace all [[runs]] by a text."""
    path = folder / "campaign.toml"
    head = path.read_text("utf-8").partition("\n[[runs]]")[0]
    path.write_text(f"{text}\n{head}", encoding="utf-8")
