"""One process in a folder at a time, on every system; the lock of a process ends with it.

The file `.lock` is locked by `filelock`. `.lock-owner` beside it names the process, because Windows
does not let others read a locked file.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import filelock

from softehl.errors import SoftehlError


class FolderInUseError(SoftehlError, RuntimeError):
    """Another process has the lock of a folder."""


class FolderLock:
    """Lock of a folder, from `take` to `release` or the end of the process.

    name: of the file; locks of several names are independent. error: raised if another process has
    the lock.
    """

    def __init__(
        self,
        folder: Path,
        name: str = ".lock",
        error: Callable[[str], SoftehlError] = FolderInUseError,
    ) -> None:
        self.path = folder / name
        self._error = error
        self._owner = folder / f"{name}-owner"
        self._lock = filelock.FileLock(self.path, thread_local=False)

    def __enter__(self) -> Self:
        """Nothing is taken yet."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Release the lock."""
        self.release()

    def take(self, patience: float = 2.0) -> None:
        """Take the lock of an existing folder; taking it again has no effect.

        The system releases the lock of a killed process when the process has ended, a moment after
        the signal: `patience` covers this.

        Raises `error` that names the owner after `patience` seconds, OSError if the folder cannot
        be written to.
        """
        if self._lock.is_locked:
            return
        try:
            self._lock.acquire(timeout=patience)
        except filelock.Timeout:
            raise self._error(
                f"{self.path.parent} is in use by a run that is under way ({self._owner_text()}); "
                "wait until it is done, or choose another folder with --out"
            ) from None
        self._owner.write_text(
            f"process {os.getpid()} on {socket.gethostname()}\n", encoding="utf-8"
        )

    def release(self) -> None:
        """Release the lock and remove its files, if it was taken."""
        if self._lock.is_locked:
            for path in (self._owner, self.path):
                with suppress(OSError):  # Windows removes the open file itself
                    path.unlink()
            self._lock.release()

    def _owner_text(self) -> str:
        try:
            return self._owner.read_text(encoding="utf-8", errors="replace").strip()[:200]
        except OSError:
            return "another process"
