"""The user's cache of derived C and compiled kernels: by content, safe for many processes.

The cache is $SOFTEHL_CACHE, else ~/Library/Caches/softehl (macOS), else $XDG_CACHE_HOME/softehl,
else ~/.cache/softehl.  It may be deleted at any time.  It holds

    derived/<key>.json    the files that a model became; the key says what they came from
    built/<key>/          those files and the shared library; the key is that of their content,
                          of the compiler, its flags, the processor and the ABI

Everything is made under a temporary name in the same folder and moved into place in one step, so
there are no locks: of two processes that make the same thing, the later one takes what is there.
What a killed process leaves behind is a temporary folder, removed a day later.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

Files = Mapping[str, str]
_SCRATCH = ".part-"
_DAY = 86400.0


def root() -> Path:
    """The cache folder, created; a temporary one, with a warning, where it cannot be written."""
    wanted = _wanted()
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        return _fallback(wanted, error.strerror or str(error))


def _wanted() -> Path:
    chosen = os.environ.get("SOFTEHL_CACHE")
    if chosen:
        return Path(chosen).expanduser().absolute()
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "softehl"
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "softehl"


@cache
def _fallback(wanted: Path, reason: str) -> Path:
    """One folder for the life of the process."""
    instead = tempfile.mkdtemp(prefix="softehl-")
    atexit.register(shutil.rmtree, instead, ignore_errors=True)
    warnings.warn(
        f"the cache {wanted} cannot be written ({reason}): kernels are built in a temporary folder "
        "and lost when this process ends; set SOFTEHL_CACHE to a folder that can be written",
        RuntimeWarning,
        stacklevel=4,
    )
    return Path(instead)


def digest(*parts: str) -> str:
    """SHA-256 of texts, each with its length."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode()
        total.update(b"%d\0" % len(data) + data)
    return total.hexdigest()


def content(files: Files) -> str:
    """SHA-256 of the names and texts of files."""
    return digest(*(t for name in sorted(files) for t in (name, files[name])))


# ------------------------------------------------------------------------------------- derived C


def recall(key: str) -> dict[str, str] | None:
    """The files stored under a key; None if there are none or they were damaged."""
    try:
        stored = json.loads((root() / "derived" / f"{key}.json").read_text(encoding="utf-8"))
        files: dict[str, str] = stored["files"]
        return files if stored["content"] == content(files) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def remember(key: str, files: Files) -> None:
    """Store files under a key."""
    text = json.dumps({"content": content(files), "files": dict(files)})
    place = root() / "derived" / f"{key}.json"
    place.parent.mkdir(exist_ok=True)
    write(place, text.encode())


def write(path: Path, data: bytes) -> None:
    """Write a file under a temporary name and move it into place."""
    handle, scratch = tempfile.mkstemp(prefix=f"{_SCRATCH}{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(scratch, 0o666 & ~_umask())
        os.replace(scratch, path)
    finally:
        Path(scratch).unlink(missing_ok=True)


@cache
def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


# --------------------------------------------------------------------------------- built folders


def folder(key: str, complete: Callable[[Path], bool], make: Callable[[Path], None]) -> Path:
    """The folder of a key; `make` fills an empty one where it is missing or not `complete`."""
    place = root() / "built" / key
    if complete(place):
        return place
    place.parent.mkdir(exist_ok=True)
    with _scratch(place.parent) as scratch:
        make(scratch)
        _publish(scratch, place, complete)
    return place


def _publish(scratch: Path, place: Path, complete: Callable[[Path], bool]) -> None:
    """Move a finished folder to its place, unless another process was first."""
    while True:
        try:
            os.rename(scratch, place)
            return
        except OSError:
            if not place.exists():
                raise
        if complete(place):
            return
        damaged = Path(tempfile.mkdtemp(prefix=_SCRATCH, dir=place.parent))
        with suppress(FileNotFoundError):  # another process has set it aside already
            os.rename(place, damaged / place.name)
        shutil.rmtree(damaged, ignore_errors=True)


@contextmanager
def _scratch(parent: Path) -> Iterator[Path]:
    _sweep(parent)
    path = Path(tempfile.mkdtemp(prefix=_SCRATCH, dir=parent))
    path.chmod(0o777 & ~_umask())
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _sweep(parent: Path) -> None:
    """Remove what processes that were killed more than a day ago left behind."""
    for path in parent.glob(f"{_SCRATCH}*"):
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > _DAY:
                shutil.rmtree(path, ignore_errors=True)
