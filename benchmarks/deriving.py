"""Derive a candidate in a process of its own, within a time limit.

`python -m benchmarks.deriving MODULE CASE ROUTE TARGET` is that process; it pickles the candidate
into the file TARGET.
"""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.candidate import Candidate
from benchmarks.problem import Case

ROOT = Path(__file__).resolve().parent.parent


class TimeLimitError(RuntimeError):
    """A derivation or a compilation took longer than it may."""


class DerivationError(RuntimeError):
    """A generator failed; the message is the last line of what it said."""


def run_limited(command: Sequence[str], limit: float) -> subprocess.CompletedProcess[str]:
    """Run a command in its own process group and end the whole group after `limit` seconds."""
    with subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            out, err = process.communicate(timeout=limit)
        except BaseException as error:
            os.killpg(process.pid, signal.SIGKILL)
            if isinstance(error, subprocess.TimeoutExpired):
                raise TimeLimitError(f"> {limit:g} s") from None
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, err)


def derive(module: str, case: Case, route: str, target: Path, limit: float) -> Candidate:
    """The candidate that `module.derive(case, route)` returns; `target` is a scratch file.

    Raises TimeLimitError or DerivationError.
    """
    command = [sys.executable, "-m", __name__, module, case.name, route, str(target)]
    done = run_limited(command, limit)
    if done.returncode != 0:
        raise DerivationError((done.stderr.strip() or "no message").splitlines()[-1])
    found = pickle.loads(target.read_bytes())
    assert isinstance(found, Candidate)
    return found


def main(module: str, case: str, route: str, target: str) -> None:
    """Derive one candidate in a process of its own and print the result."""
    candidate = importlib.import_module(module).derive(Case[case], route)
    Path(target).write_bytes(pickle.dumps(candidate))


if __name__ == "__main__":
    main(*sys.argv[1:])
