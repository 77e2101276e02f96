"""Fenced blocks of a documentation page, and a reader who does what they say, in order.

A block is opened by three backticks and a word:

    python FILE   the content of FILE; must be that of docs/models/FILE, and is written for the rest
    python        is run, all of a page in one namespace
    text          what the `python` block before it prints
    toml FILE     is written for the rest
    console       lines `$ command` and what it prints, compared without the numbers
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import softehl

_FENCE = re.compile(r"^```(\S+)[ ]?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?|\bcached\b")
"""A number, or the word that a table has for the seconds of a kernel built before."""


@dataclass(frozen=True)
class Block:
    """A fenced block: its kind, what stands behind it on the line, its lines, its place."""

    kind: str
    name: str
    text: str
    line: int


def blocks(page: str) -> list[Block]:
    """Every fenced block of a page, in order."""
    return [
        Block(m[1], m[2].strip(), m[3], page.count("\n", 0, m.start()) + 1)
        for m in _FENCE.finditer(page)
    ]


class Reader:
    """Does what a page says in the current folder; `AssertionError` where it does not hold."""

    def __init__(self, models: Path) -> None:
        self.models = models
        self.namespace: dict[str, Any] = {"__name__": "page"}
        self.printed = ""

    def read(self, block: Block) -> None:
        """Do one block."""
        if block.kind == "python" and block.name:
            expected = (self.models / block.name).read_text(encoding="utf-8")
            assert block.text == expected, f"line {block.line}: docs/models/{block.name} differs"
            Path(block.name).write_text(block.text, encoding="utf-8")
        elif block.kind == "python":
            code = compile("\n" * block.line + block.text, "page", "exec", dont_inherit=True)
            self.printed = self._output(lambda: exec(code, self.namespace))
        elif block.kind == "text":
            assert self.printed == block.text, f"line {block.line}: printed {self.printed!r}"
        elif block.kind == "toml" and block.name:
            Path(block.name).write_text(block.text, encoding="utf-8")
        elif block.kind == "console":
            self._console(block)
        else:
            raise AssertionError(f"line {block.line}: no block of kind {block.kind!r}")

    def _console(self, block: Block) -> None:
        for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition("\n")
            name, *arguments = shlex.split(command)
            assert name == "softehl", f"line {block.line}: {command}"
            codes: list[int] = []
            printed = self._output(partial(self._run, arguments, codes))
            assert codes == [0], f"line {block.line}: exit code {codes}"
            if shown.strip():
                assert words(printed) == words(shown), f"line {block.line}: printed {printed}"

    @staticmethod
    def _run(arguments: list[str], codes: list[int]) -> None:
        codes.append(softehl.main(arguments))

    @staticmethod
    def _output(action: Any) -> str:
        with contextlib.redirect_stdout(io.StringIO()) as stream:
            action()
        return stream.getvalue()


def words(text: str) -> list[str]:
    """Words of a text without the numbers in it; rules of tables are as wide as these."""
    return [w for w in _NUMBER.sub("#", text).split() if w.strip("─")]
