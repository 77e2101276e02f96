"""Lines of C in blocks, and values of lanes from and to rows of elements."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Lines:
    """Lines of C."""

    lines: list[str] = field(default_factory=list)
    depth: int = 1

    def add(self, text: str) -> None:
        """One line."""
        self.lines.append("    " * self.depth + text)

    def idle(self, *names: str) -> None:
        """Variables that may be left unread."""
        self.add(" ".join(f"(void){n};" for n in names))

    def open(self, head: str) -> None:
        """A block begins."""
        self.add(f"{head} {{")
        self.depth += 1

    def close(self) -> None:
        """A block ends."""
        self.depth -= 1
        self.add("}")


def load(out: Lines, to: str, source: str, count: int, width: str) -> None:
    """Values of every lane from rows of the elements: `to`[k] = `source`[k]."""
    for k in range(0, count, 4):
        size = min(4, count - k)
        pointers = ", ".join(f"&{to}[{k + i}]" for i in range(size))
        out.add(f"softehl_load{size}({source} + {k}, {width}, {pointers});")


def store(out: Lines, to: str, source: str, count: int, width: str) -> None:
    """Values of every lane to rows of the elements."""
    whole = count - count % 4
    if whole > 64:
        out.open(f"for (ptrdiff_t k = 0; k < {whole}; k += 4)")
        values = ", ".join(f"{source}[k + {i}]" for i in range(4))
        out.add(f"softehl_store4({to} + k, {width}, {values});")
        out.close()
    for k in range(whole if whole > 64 else 0, count, 4):
        size = min(4, count - k)
        values = ", ".join(f"{source}[{k + i}]" for i in range(size))
        out.add(f"softehl_store{size}({to} + {k}, {width}, {values});")
