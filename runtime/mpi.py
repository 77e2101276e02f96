"""PETSc and MPI: found in the right order, and left together."""

from __future__ import annotations

import importlib
import sys
import time
from functools import cache
from types import TracebackType
from typing import Any, TextIO

from softehl.errors import SoftehlError
from softehl.system import unread_bytes


class MissingPetsc(SoftehlError, ValueError):  # noqa: N818 (named after what it is)
    """PETSc is not installed; the message says what to do."""


_TOGETHER = 1.0  # seconds within which an error of all processes is one
_READ = 10.0  # seconds at most until the launcher has read the line of an error


_EXPLAINED = (ValueError, ArithmeticError, RuntimeError, OSError)
"""Errors that say in their text what is wrong; others are of the script."""


@cache
def petsc() -> Any:
    """The module petsc4py.PETSc, with the options of the command line.

    Raises MissingPetsc where it is not installed.
    """
    try:
        _bundled()
        import petsc4py
    except ImportError as error:
        raise MissingPetsc(
            f'"petsc": {error}; {_extra()}, or install petsc4py and mpi4py of your cluster'
        ) from None
    # one dash is PETSc's, two are of softehl or the script
    petsc4py.init([word for word in sys.argv if not word.startswith("--")])
    PETSc = importlib.import_module("petsc4py.PETSc")
    PETSc.Sys.popErrorHandler()  # errors are exceptions, not pages of text from every process
    PETSc.Sys.pushErrorHandler("python")
    sys.excepthook = _leave
    return PETSc


def _extra() -> str:
    """Way to the extra that brings PETSc; pip installs nothing of it, silently, on older Python."""
    extra = "pip install 'softehl[mpi]'"
    if sys.version_info >= (3, 12):
        return extra
    this = ".".join(map(str, sys.version_info[:2]))
    return f"{extra} needs Python 3.12 or newer, this is {this}"


@cache
def slepc() -> Any:
    """The module slepc4py.SLEPc.  Raises MissingPetsc where it is not installed."""
    petsc()
    try:
        import slepc4py
    except ImportError as error:
        raise MissingPetsc(
            f'eigenvalues with engine = "petsc": {error}; {_extra()}, or install slepc4py of your '
            "cluster"
        ) from None
    slepc4py.init()
    return importlib.import_module("slepc4py.SLEPc")


def _bundled() -> None:
    """Let the wheel that brings PETSc, MPI and mpiexec put its libraries in order, if it is one."""
    try:
        importlib.import_module("dolfinx_solver")
    except ModuleNotFoundError as error:
        if error.name != "dolfinx_solver":
            raise


@cache
def world() -> Any:
    """All processes that mpirun started, as a communicator of mpi4py."""
    return petsc().COMM_WORLD.tompi4py()


def _leave(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    """End all processes on an error that nobody caught, with one line of text: of process 0 where
    all have the error; else of the one that has it, for the others do not know. Errors in the
    script itself, and those of a process alone in the world, have their traceback.
    """
    comm = world()
    together = _everywhere(comm)
    if comm.size == 1 or not (issubclass(kind, _EXPLAINED) or (together and comm.rank)):
        sys.__excepthook__(kind, error, traceback)
    if comm.size > 1 and not together:
        who = f"process {comm.rank} of {comm.size} failed, all end: "
        print(f"softehl: {who}{_line(error)}", file=sys.stderr, flush=True)
        _await_reader(sys.stderr)
        comm.Abort(1)
    elif comm.size > 1 and comm.rank == 0 and issubclass(kind, _EXPLAINED):
        print(f"softehl: {_line(error)}", file=sys.stderr, flush=True)


def _everywhere(comm: Any) -> bool:
    """True if all processes arrive within a moment."""
    request, end = comm.Ibarrier(), time.monotonic() + _TOGETHER
    while not request.Test():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True


def _await_reader(stream: TextIO) -> None:
    """Wait until the launcher has read the stream, a pipe: MPI_Abort drops what is unread."""
    end = time.monotonic() + _READ
    try:
        while unread_bytes(stream) and time.monotonic() < end:
            time.sleep(0.01)
    except (OSError, ValueError):  # nothing to wait for: closed, or no file at all
        return


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
