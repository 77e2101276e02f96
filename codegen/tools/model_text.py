"""The text of a model file and of the files of its folder that it imports (no SymPy needed)."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from softehl.errors import SoftehlError

BESIDE = "beside the model: "
"""Beginning of the name of a file that is called as seen from the folder of the model."""


class ModelFileError(SoftehlError, ValueError):
    """A model file cannot be used; the message names the file, the line and the remedy."""


def read(path: Path) -> str:
    """Text of a file; raises `ModelFileError`."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise ModelFileError(f"cannot read {shorten(path)}: {reason}") from None


def shorten(path: Path) -> str:
    """A path for a message, without the middle of one that no file system takes."""
    text = str(path)
    return text if len(path.name) <= 255 else f"{text[:40]}...{text[-20:]}"


def sources(path: Path) -> dict[str, str]:
    """Text of the file and of all its imports from its folder, by relative name.

    Found by reading the import statements; nothing is run.
    """
    path = path.resolve()
    out: dict[str, str] = {}
    waiting = [path]
    while waiting:
        file = waiting.pop()
        name = file.relative_to(path.parent).as_posix()
        if name not in out:
            out[name] = read(file)
            names = imported(path.parent, file, out[name])
            waiting += [p for name in names for p in _files_of(path.parent, name)]
    return dict(sorted(out.items()))


def digest(texts: Mapping[str, str]) -> str:
    """SHA-256 of `sources`."""
    total = hashlib.sha256()
    for name, text in texts.items():
        total.update(f"{name}\0{len(text)}\0{text}".encode())
    return total.hexdigest()


def digest_of(path: str) -> str:
    """SHA-256 of a file, empty where it cannot be read."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


def imported(folder: Path, file: Path, text: str) -> list[str]:
    """Modules that the import statements of `file` may mean, as seen from `folder`."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return []  # running the file says what is wrong with it
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            package = file.parents[node.level - 1] if node.level else folder
            inside = package.is_relative_to(folder) and package != folder
            prefix = ".".join(package.relative_to(folder).parts) + "." if inside else ""
            base = prefix + (node.module or "")
            names += [base, *(f"{base.rstrip('.')}.{a.name}" for a in node.names)]
    return names


def _files_of(folder: Path, name: str) -> Iterator[Path]:
    """The files that `import name` would run, of those in `folder`."""
    parts = [p for p in name.split(".") if p]
    for k in range(1, len(parts) + 1):
        stem = folder.joinpath(*parts[:k])
        candidates = (stem / "__init__.py", stem.with_name(f"{stem.name}.py"))
        yield from (c for c in candidates if c.is_file())
