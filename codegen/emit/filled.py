"""Short statements of C side by side in lines of one width."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

WIDTH = 100
_DECLARED = re.compile(r"((?:const )?(?:V|M|double|int)) (\w.*);")
_KEPT = re.compile(r"(?:for|if|while|return|else|#|/|\*|\}|static|typedef)")


def filled(lines: Iterable[str]) -> list[str]:
    """Statements in filled lines: neighbours of one depth share them, declarations share a type."""
    out: list[str] = []
    split = [line for text in lines for line in text.split("\n")]
    for depth, group in groupby(split, _depth):
        alike = list(group)
        out += alike if depth < 0 else _lines(" " * depth, _declared(s.strip() for s in alike))
    return out


def _depth(line: str) -> int:
    """Spaces before a simple statement; -1 of any other line."""
    text = line.lstrip(" ")
    simple = text.endswith(";") and not _KEPT.match(text) and "= {" not in text.replace("= {0}", "")
    return len(line) - len(text) if simple else -1


def _declared(statements: Iterable[str]) -> Iterator[Sequence[str]]:
    """Pieces that a line may end after; a declaration of several variables is one statement."""
    kind = ""
    names: list[str] = []
    for s in statements:
        found = _DECLARED.fullmatch(s)
        if names and (found is None or found[1] != kind):
            yield _joined(kind, names)
            names = []
        if found is None:
            yield [s]
        else:
            kind = found[1]
            names.append(found[2])
    if names:
        yield _joined(kind, names)


def _joined(kind: str, names: Sequence[str]) -> list[str]:
    first, *rest = [f"{name}," for name in names[:-1]] + [f"{names[-1]};"]
    return [f"{kind} {first}", *rest]


def _lines(indent: str, statements: Iterable[Sequence[str]]) -> list[str]:
    out: list[str] = []
    alone = True
    for pieces in statements:
        before, alone = alone, len(pieces) > 1
        for k, piece in enumerate(pieces):
            apart = not k and (alone or before)
            if out and not apart and len(out[-1]) + 1 + len(piece) <= WIDTH:
                out[-1] += f" {piece}"
            else:
                out.append(f"{indent}{'    ' if k else ''}{piece}")
    return out
