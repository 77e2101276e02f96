"""How an error of one process is heard before all end; needs neither MPI nor PETSc."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import pytest

from softehl.runtime import mpi

Pipe = tuple[int, TextIO]
LINE = "softehl: a line\n"


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    """Where the launcher reads, and the standard error of a process."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "w", encoding="utf-8") as stderr:
        yield reading, stderr
    os.close(reading)


def awaited(stream: TextIO) -> float:
    """Seconds until what is printed counts as read."""
    began = time.monotonic()
    mpi._await_reader(stream)
    return time.monotonic() - began


def test_what_is_printed_is_read_before_all_end(pipe: Pipe) -> None:
    reading, stderr = pipe
    print(LINE, end="", file=stderr, flush=True)
    reads = threading.Event()

    def read() -> None:
        reads.set()
        os.read(reading, 100)

    launcher = threading.Timer(0.3, read)
    launcher.start()
    awaited(stderr)
    assert reads.is_set()
    launcher.join()


def test_a_launcher_that_never_reads_is_left(pipe: Pipe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mpi, "_READ", 0.2)
    print(LINE, end="", file=pipe[1], flush=True)
    assert awaited(pipe[1]) >= 0.2


def test_files_empty_and_closed_streams_are_not_waited_for(
    pipe: Pipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mpi, "_READ", 60.0)
    assert awaited(pipe[1]) < 30.0
    with (tmp_path / "errors.txt").open("w", encoding="utf-8") as file:
        print(LINE, end="", file=file, flush=True)
        assert awaited(file) < 30.0
    assert awaited(file) < 30.0
