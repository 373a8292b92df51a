"""Files and folders that appear whole or not at all: written beside their place, then renamed."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write UTF-8 text; line ends stay as given, so equal content is equal bytes everywhere."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write content to path, which keeps what it had until the new content is complete on disk."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, beside = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(beside, _ordinary_mode(path))
        os.replace(beside, path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise


@contextmanager
def folder(path: str | os.PathLike[str], resume_key: str | None = None) -> Iterator[Path]:
    """Hand out a staging folder beside path; its content moves to path when the block ends well.

    A path that exists already keeps its other files; files of the same name are replaced.

    Args:
        path: the folder to write.
        resume_key: None: an interrupted block leaves nothing behind. A name made from everything
            the content depends on (a hash of the inputs): the staging folder survives an
            interruption, and the next call with the same key hands it out again, as it was left.
    """
    path = Path(path).resolve()  # "." has a name and a parent only then
    path.parent.mkdir(parents=True, exist_ok=True)
    if resume_key is None:
        beside = tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
        staging = Path(beside)
        staging.chmod(_ordinary_mode(path, for_new=0o777))
    else:
        staging = path.parent / f".{path.name}.{resume_key}.partial"
        staging.mkdir(exist_ok=True)
    try:
        yield staging
    except BaseException:
        if resume_key is None:
            shutil.rmtree(staging, ignore_errors=True)
        raise
    _move_into(staging, path)


def _move_into(staging: Path, path: Path) -> None:
    """Rename the whole folder where nothing is in the way, otherwise file by file, deepest first.

    Deepest first: an index at the top (campaign.toml) appears after the files that it names.
    """
    if not path.exists():
        os.replace(staging, path)
        return
    files = [file for file in staging.rglob("*") if file.is_file()]
    for file in sorted(files, key=lambda f: (-len(f.relative_to(staging).parts), str(f))):
        target = path / file.relative_to(staging)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(file, target)
    shutil.rmtree(staging)


def _ordinary_mode(path: Path, for_new: int = 0o666) -> int:
    """Permissions of what is replaced, or of anything new (tempfile's own are private)."""
    if path.exists():
        return path.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return for_new & ~mask
