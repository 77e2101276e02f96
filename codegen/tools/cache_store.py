"""The user's cache of derived C and compiled kernels: by content, safe for many processes.

The cache is $SOFTEHL_CACHE, else ~/Library/Caches/softehl (macOS), else $XDG_CACHE_HOME/softehl,
else ~/.cache/softehl.  It may be deleted at any time.  It holds

    derived/<key>.json    the files that a model became; the key says what they came from
    built/<key>/          those files and the shared library; the key is that of their content,
                          of the compiler, its flags, the processor and the ABI

Everything is made under a temporary name in the same folder and moved into place in one step, so
no reader waits and nothing is ever half there.  Of two processes that make the same thing one waits
for the other while that lives; this only spares work, and is left out where files have no locks.
A killed process leaves a temporary folder behind, which is removed a day later.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from softehl.codegen.tools import cache_dir
from softehl.codegen.tools.cache_dir import CacheError, require_own, root, writable
from softehl.codegen.tools.model_text import BESIDE, digest_of
from softehl.folder_lock import FolderInUseError, FolderLock

Files = Mapping[str, str]
_SCRATCH = ".part-"
_DAY = 86400.0
_PATIENCE = 300.0


def digest(parts: Iterable[str]) -> str:
    """SHA-256 of texts, each with its length."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode()
        total.update(b"%d\0" % len(data) + data)
    return total.hexdigest()


def content(files: Files) -> str:
    """SHA-256 of the names and texts of files."""
    return digest(t for name in sorted(files) for t in (name, files[name]))


# ------------------------------------------------------------------------------------- derived C


def recall(key: str, model: Path | None = None) -> dict[str, str] | None:
    """The files stored under a key; None if there are none, they were damaged, or one of the files
    that they depend on is another one now. model: file beside which some of these are.
    """
    try:
        derived = root() / "derived"
        if cache_dir.fault(derived):
            return None
        stored = json.loads((derived / f"{key}.json").read_text(encoding="utf-8"))
        files: dict[str, str] = stored["files"]
        folder = "" if model is None else f"{model.resolve().parent}/"
        current = all(
            digest_of(path.replace(BESIDE, folder, 1)) == digest
            for path, digest in stored["read"].items()
        )
        return files if current and stored["content"] == content(files) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def remember(key: str, files: Files, read: Mapping[str, str] | None = None) -> None:
    """Store files under a key.  Raises `CacheError`, OSError.

    read: SHA-256 of files that they depend on beside what the key says, by path.
    """
    stored = {"content": content(files), "files": dict(files), "read": dict(read or {})}
    text = json.dumps(stored)
    write(require_own(root() / "derived") / f"{key}.json", text.encode(), mode=0o644)


def write(path: Path, data: bytes, mode: int = 0o666) -> None:
    """Write a file atomically: under a temporary name, then renamed; safe against a power cut.

    Raises OSError with the name of the file.
    """
    try:
        handle, scratch = tempfile.mkstemp(prefix=f"{_SCRATCH}{path.name}.", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.chmod(scratch, mode & ~_umask())
            os.replace(scratch, path)
        finally:
            Path(scratch).unlink(missing_ok=True)
    except OSError as error:
        raise type(error)(error.errno, error.strerror or str(error), str(path)) from None


@cache
def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


# --------------------------------------------------------------------------------- built folders


def folder(
    key: str,
    complete: Callable[[Path], bool],
    make: Callable[[Path], None],
    *,
    keep: bool = False,
) -> Path:
    """The folder of a key; `make` fills an empty one where it is missing or not `complete`.

    keep: raise `CacheError` where the cache cannot be used, instead of taking a temporary folder.
    """

    def usable(candidate: Path) -> bool:
        try:
            return not cache_dir.fault(candidate) and complete(candidate)
        except OSError:
            return False

    existing = _existing(key, usable)
    if existing is not None:
        return existing
    built = require_own((writable() if keep else root()) / "built")
    target = built / key
    with _alone(built / f".lock-{key}"):
        if not usable(target):
            with _scratch(built) as scratch:
                make(scratch)
                _synchronise(scratch)
                _publish(scratch, target, usable)
                _synchronise(built)
    return target


def _existing(key: str, usable: Callable[[Path], bool]) -> Path | None:
    """The folder of a key in a cache that need not be writable."""
    try:
        built = cache_dir.configured() / "built"
        safe = not any(map(cache_dir.fault, (built.parent, built)))
    except (CacheError, OSError):
        return None
    candidate = built / key
    return candidate if safe and usable(candidate) else None


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Wait, within reason, for another process that makes the same: it spares the work, no more."""
    with FolderLock(lock.parent, lock.name) as folder_lock:
        with suppress(FolderInUseError, OSError):  # also on a file system without locks
            folder_lock.take(_PATIENCE)
        yield


def _synchronise(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _publish(scratch: Path, target: Path, complete: Callable[[Path], bool]) -> None:
    """Rename a finished folder to its target, unless another process was first."""
    while True:
        try:
            os.rename(scratch, target)
            return
        except OSError:
            if not target.exists():
                raise
        if complete(target):
            return
        damaged = Path(tempfile.mkdtemp(prefix=_SCRATCH, dir=target.parent))
        with suppress(OSError):  # a folder that may not be written cannot be moved
            target.chmod(0o700)
        with suppress(FileNotFoundError):  # another process has set it aside already
            os.rename(target, damaged / target.name)
        shutil.rmtree(damaged, ignore_errors=True)


@contextmanager
def _scratch(parent: Path) -> Iterator[Path]:
    _sweep(parent)
    path = Path(tempfile.mkdtemp(prefix=_SCRATCH, dir=parent))
    path.chmod(0o755 & ~_umask())
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _sweep(parent: Path) -> None:
    """Remove temporary folders of processes that were killed more than a day ago."""
    for path in parent.glob(f"{_SCRATCH}*"):
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > _DAY:
                shutil.rmtree(path, ignore_errors=True)
