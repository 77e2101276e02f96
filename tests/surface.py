"""The public surface, read from the sources: classes, methods, and the names in annotations."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import softehl

ROOT = Path(__file__).parents[1]
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Place:
    """A name in a module of the package."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


@dataclass(frozen=True)
class Member:
    """A public class or function, or a method of one."""

    label: str
    module: str
    node: ast.AST


@cache
def tree(module: str) -> ast.Module:
    room, *rest = module.split(".")[1:] or [""]
    path = ROOT.joinpath(room, *rest) if (ROOT / room).is_dir() and room else None
    path = path or ROOT.joinpath("src", *module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def names(module: str) -> dict[str, ast.AST]:
    """What each name at the top of a module stands for, imports for types included."""
    found: dict[str, ast.AST] = {}
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom):
            found.update({(a.asname or a.name): node for a in node.names})
    for node in tree(module).body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            found[node.name] = node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = node
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = node
    return found


def definition(module: str, name: str) -> tuple[str, ast.AST] | None:
    """Module and node that a name leads to; None out of the package."""
    node = names(module).get(name)
    if isinstance(node, ast.ImportFrom):
        if node.module is None or not node.module.startswith("softehl"):
            return None
        alias = next(a for a in node.names if (a.asname or a.name) == name)
        return definition(node.module, alias.name)
    return None if node is None else (module, node)


def words(annotation: ast.AST) -> Iterator[str]:
    """Names in an annotation, also in one that is written as a text."""
    for node in ast.walk(annotation):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            try:
                yield from words(ast.parse(node.value, mode="eval"))
            except SyntaxError:
                continue


def classes(
    module: str, annotation: ast.AST, within: frozenset[str] = frozenset()
) -> Iterator[Place]:
    """Classes of the package that an annotation names, by way of aliases, too."""
    for word in words(annotation):
        found = definition(module, word)
        if found is None or word in within:
            continue
        where, node = found
        if isinstance(node, ast.ClassDef):
            yield Place(where, node.name)
        elif isinstance(node, ast.AnnAssign | ast.Assign) and node.value is not None:
            yield from classes(where, node.value, within | {word})


def lineage(module: str, kind: ast.ClassDef) -> Iterator[tuple[str, ast.ClassDef]]:
    """A class, then its bases in the package."""
    yield module, kind
    for base in kind.bases:
        for word in words(base):
            found = definition(module, word)
            if found is not None and isinstance(found[1], ast.ClassDef):
                yield from lineage(found[0], found[1])


def exports() -> dict[str, tuple[str, ast.AST]]:
    """Public name -> where it is defined; modules are left out."""
    found = {}
    for name in softehl.__all__:
        place = (softehl._PUBLIC | softehl._MODELLING).get(name, "softehl")
        module, colon, attribute = place.partition(":")
        if not colon or attribute:
            defined = definition(module, attribute or name)
            assert defined is not None, name
            found[name] = defined
    return found


def annotated(member: Member) -> Iterator[tuple[str, ast.expr]]:
    """Name and annotation of each parameter or field, "return" of what is returned."""
    node = member.node
    if isinstance(node, ast.ClassDef):
        yield from fields(node)
    elif isinstance(node, Function):
        for argument in arguments(node):
            if argument.annotation is not None:
                yield argument.arg, argument.annotation
        if node.returns is not None:
            yield "return", node.returns


def fields(kind: ast.ClassDef) -> list[tuple[str, ast.expr]]:
    """Public annotated names of a class, but for constants."""
    found = []
    for node in kind.body:
        name = ast.unparse(node.target) if isinstance(node, ast.AnnAssign) else "_"
        if isinstance(node, ast.AnnAssign) and not name.startswith("_"):
            found.append((name, node.annotation))
    return [(name, annotation) for name, annotation in found if "ClassVar" not in words(annotation)]


def arguments(node: Function) -> list[ast.arg]:
    """All parameters of a function, without self and cls."""
    a = node.args
    first, last = ([arg] if arg is not None else [] for arg in (a.vararg, a.kwarg))
    every = [*a.posonlyargs, *a.args, *first, *a.kwonlyargs, *last]
    return [arg for arg in every if arg.arg not in ("self", "cls")]
