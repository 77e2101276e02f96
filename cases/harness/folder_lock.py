"""One run in a folder at a time: a lock that the system takes back when its owner ends."""

import fcntl
import os
import socket
from pathlib import Path
from typing import Self

from softehl.cases.harness.errors import BadInput

_NAME = ".lock"


class FolderLock:
    """The lock of a folder, held from :meth:`take` to :meth:`release` or the end of the process."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / _NAME
        self._handle: int | None = None

    def __enter__(self) -> Self:
        """Nothing is taken yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Release the lock."""
        self.release()

    def take(self) -> None:
        """Take the lock of a folder that is there; again has no effect.

        Raises BadInput that names the owner if another process has it, OSError if the folder
        cannot be written to.
        """
        while self._handle is None:
            handle = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                owner = os.read(handle, 200).decode(errors="replace").strip() or "another process"
                os.close(handle)
                raise BadInput(
                    f"{self.path.parent} is in use by a run that is under way ({owner}); wait "
                    "until it is done, or choose another folder with --out"
                ) from None
            if not self._is_still_there(handle):  # its last owner has just removed it
                os.close(handle)
                continue
            os.ftruncate(handle, 0)
            os.write(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
            self._handle = handle

    def release(self) -> None:
        """Give the lock back and remove its file, if it was taken."""
        if self._handle is not None:
            self.path.unlink(missing_ok=True)
            os.close(self._handle)
            self._handle = None

    def _is_still_there(self, handle: int) -> bool:
        try:
            return os.path.samestat(os.fstat(handle), os.stat(self.path))
        except FileNotFoundError:
            return False
