"""Calls of the operating system that Linux, macOS and Windows answer differently.

No other module of softehl calls what one of them lacks (`tests/packaging/test_systems.py`).
"""

from __future__ import annotations

import array
import os
import re
import signal
import stat
from pathlib import Path
from typing import TextIO

END_SIGNALS: tuple[signal.Signals, ...] = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)
)
"""Signals that ask a process to end; SIGHUP is a closed terminal, on Windows SIGBREAK."""
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
_RESERVED = '<>:"|?*/\\'


def processors() -> int:
    """Number of processors that this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)  # Linux alone
    return len(allowed(0)) if allowed else os.cpu_count() or 1


def rights_fault(folder: Path, remedy: str) -> str:
    """Why others may change the content of a folder; empty if they may not.  Raises OSError.

    Windows keeps the folders of a user from others by lists of rights, which are not read here.
    """
    user = getattr(os, "geteuid", None)
    if user is None:
        return ""
    status = folder.stat()
    if status.st_uid != user():
        return f"it belongs to another user, number {status.st_uid}; {remedy}"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others may write to it; delete it, or if all is yours: chmod -R go-w {folder}"
    return ""


def unread_bytes(stream: TextIO) -> int:
    """Bytes in a pipe that its reader has not read yet; 0 for another stream, and on Windows.

    Raises OSError, ValueError for a closed stream.
    """
    try:
        import fcntl
        import termios
    except ImportError:
        return 0
    out, unread = stream.fileno(), array.array("i", [0])
    if stat.S_ISFIFO(os.fstat(out).st_mode):
        fcntl.ioctl(out, termios.FIONREAD, unread)
    return unread[0]


def name_fault(name: str) -> str:
    """Why a name cannot be that of a file on every system; empty if it can."""
    if _DEVICES.fullmatch(name):
        return "Windows reserves it for a device"
    wrong = [c for c in name if c in _RESERVED or ord(c) < 32]
    if wrong:
        return f"a file name has no {wrong[0]!r} on Windows"
    return "a file name does not end so on Windows" if name.endswith((".", " ")) else ""
