"""The C compiler of the user as a command, and its calls."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence

from softehl.codegen.abi import BuildError, NoCompilerError


def compiler() -> list[str]:
    """The C compiler as a command: $CC, or cc from the PATH."""
    command = os.environ.get("CC", "")
    try:
        return shlex.split(command) or ["cc"]
    except ValueError as error:
        reason = str(error)[:1].lower() + str(error)[1:]
        raise BuildError(
            f"CC={command!r} is no command ({reason}): set CC to a C compiler"
        ) from None


def called(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Call a command of the compiler; raises BuildError where it cannot be run."""
    if shutil.which(command[0]) is None:
        kind = BuildError if os.environ.get("CC", "").strip() else NoCompilerError
        raise kind(
            f"no C compiler: {command[0]!r} is not on the PATH; install one, or set CC to one"
        )
    try:
        return subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False, input=""
        )
    except OSError as error:
        raise BuildError(
            f"{command[0]} cannot be run ({error.strerror}): set CC to a C compiler"
        ) from None
