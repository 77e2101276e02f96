"""Lines of C in blocks, and values of lanes from and to rows of elements."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field


@dataclass
class Lines:
    """Lines of C."""

    lines: list[str] = field(default_factory=list)
    depth: int = 1

    def add(self, text: str) -> None:
        """One line."""
        self.lines.append("    " * self.depth + text)

    def idle(self, names: Iterable[str]) -> None:
        """Mark variables that may stay unread."""
        self.add(" ".join(f"(void){n};" for n in names))

    def open(self, head: str) -> None:
        """A block begins."""
        self.add(f"{head} {{")
        self.depth += 1

    def close(self) -> None:
        """A block ends."""
        self.depth -= 1
        self.add("}")


LONG = 64
"""Values of an element above which they are moved in a loop: straight code gains nothing there."""


def load(out: Lines, to: str, source: str, count: int, width: str) -> None:
    """Values of every lane from rows of the elements: `to`[k] = `source`[k]."""
    _moved(out, count, lambda at: f"&{to}[{at}]", f"softehl_load{{}}({source} + {{}}, {width}, ")


def store(out: Lines, to: str, source: str, count: int, width: str) -> None:
    """Values of every lane to rows of the elements."""
    _moved(out, count, lambda at: f"{source}[{at}]", f"softehl_store{{}}({to} + {{}}, {width}, ")


def _moved(out: Lines, count: int, value: Callable[[str], str], call: str) -> None:
    """Calls for four neighbours each, and for those that are left."""
    in_groups = count - count % 4 if count > LONG else 0
    if in_groups:
        out.open(f"for (ptrdiff_t k = 0; k < {in_groups}; k += 4)")
        out.add(f"{call.format(4, 'k')}{', '.join(value(f'k + {i}') for i in range(4))});")
        out.close()
    for k in range(in_groups, count, 4):
        size = min(4, count - k)
        values = ", ".join(value(str(k + i)) for i in range(size))
        out.add(f"{call.format(size, k)}{values});")
