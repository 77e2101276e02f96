"""Native build of the shipped kernels for the processor of this machine.

It is compiled at its first use, where there is a C compiler, into the user's cache:
`python -m softehl.codegen.tools.build` does so in a process of its own, and knows in every later
one where it is.  $SOFTEHL_KERNELS = "plain" asks for the plain library instead: the same numbers on
every processor of a platform, and no compiler called.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

from softehl.errors import SoftehlError

_PACKAGES = Path(__file__).parents[3]
"""The folder in which `import softehl` finds it."""
_BUILD = ("-P", "-m", "softehl.codegen.tools.build")
_NO_COMPILER = 3
_SOON, _PATIENCE = 1.0, 900.0


class NotTunedError(SoftehlError, RuntimeError):
    """There is no tuned library.  expected: there is no compiler, or none is wanted."""

    def __init__(self, reason: str, expected: bool = False) -> None:
        super().__init__(reason)
        self.expected = expected


def tuned() -> Path:
    """Path of the library tuned to this processor, built if need be; NotTunedError if not."""
    wish = os.environ.get("SOFTEHL_KERNELS") or "tuned"
    if wish == "plain":
        raise NotTunedError("SOFTEHL_KERNELS asks for the plain ones", expected=True)
    if wish != "tuned":
        raise NotTunedError(f"SOFTEHL_KERNELS is {wish!r}, must be 'tuned' or 'plain'")
    if getattr(sys, "frozen", False) or not sys.executable:
        raise NotTunedError("this is no ordinary Python, which could build them", expected=True)
    paths_to_packages = [str(_PACKAGES), *filter(None, [os.environ.get("PYTHONPATH")])]
    paths = {
        "PYTHONPATH": os.pathsep.join(paths_to_packages),
        "PYTHONIOENCODING": "utf-8:surrogateescape",
    }
    try:
        with subprocess.Popen(
            [sys.executable, *_BUILD],
            env={**os.environ, **paths},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="surrogateescape",
        ) as process:
            out, err = _awaited(process)
    except OSError as error:
        raise NotTunedError(f"no process to build them can be started ({error})") from None
    if process.returncode == 0 and out.strip():
        return Path(out.splitlines()[-1])
    lines = err.strip().splitlines() or [f"exit code {process.returncode}"]
    message = next((w for w in lines if w.startswith("softehl: ")), lines[-1])
    raise NotTunedError(message.removeprefix("softehl: "), process.returncode == _NO_COMPILER)


def _awaited(process: subprocess.Popen[str]) -> tuple[str, str]:
    """Output of a process; one that takes a while is announced on a terminal."""
    try:
        return process.communicate(timeout=_SOON)
    except subprocess.TimeoutExpired:
        if sys.stderr.isatty() and multiprocessing.parent_process() is None:
            print("softehl: compiling the kernels for this processor, once", file=sys.stderr)
    try:
        return process.communicate(timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        raise NotTunedError(f"compiling them took more than {_PATIENCE:.0f} s") from None
