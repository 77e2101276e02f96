"""Place of the user's cache, and whether its content may be run.

The cache contains code. A cache that belongs to somebody else, or that others may write to, is not
used.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path

from softehl.errors import SoftehlError
from softehl.log import warn
from softehl.system import rights_fault

_REMEDY = "set SOFTEHL_CACHE to a folder of yours that can be written"


class CacheError(SoftehlError, RuntimeError):
    """The cache cannot be used; the message is one line with a remedy."""


def root() -> Path:
    """The cache folder, created; a temporary one, with a warning, where it cannot be used."""
    try:
        return writable()
    except CacheError as error:
        return _fallback(str(error))


def writable() -> Path:
    """The cache folder, created.  Raises `CacheError` where it is not safe or not writable."""
    folder = configured()
    try:
        require_own(folder)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        reason = error.strerror or str(error)
        raise CacheError(f"the cache {folder} cannot be written ({reason}): {_REMEDY}") from None


def require_own(folder: Path) -> Path:
    """Create a folder that only this user may write to.  Raises `CacheError` if it is another."""
    folder.mkdir(mode=0o755, parents=True, exist_ok=True)
    reason = fault(folder)
    if reason:
        raise CacheError(f"the cache {folder} is not used: {reason}")
    return folder


def fault(folder: Path) -> str:
    """Why code in a folder is not to be run; empty if it may.  Raises OSError."""
    return rights_fault(folder, _REMEDY)


def configured() -> Path:
    """Folder of the cache.  Raises `CacheError` if there is no home folder."""
    variable = os.environ.get("SOFTEHL_CACHE")
    try:
        if variable:
            return Path(variable).expanduser().absolute()
        if sys.platform == "darwin":
            return Path.home() / "Library" / "Caches" / "softehl"
        base = os.environ.get("XDG_CACHE_HOME")
        return (Path(base) if base else Path.home() / ".cache") / "softehl"
    except (RuntimeError, OSError) as error:
        raise CacheError(f"there is no place for the cache ({error}): {_REMEDY}") from None


@cache
def _fallback(reason: str) -> Path:
    """One folder for the life of the process."""
    instead = tempfile.mkdtemp(prefix="softehl-")
    atexit.register(shutil.rmtree, instead, ignore_errors=True)
    warn(
        f"{reason}; until then kernels are built in a temporary folder and lost when this process "
        "ends",
        RuntimeWarning,
        stacklevel=4,
    )
    return Path(instead)
