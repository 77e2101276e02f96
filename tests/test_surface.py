"""The public surface: exported, documented in numpydoc form, annotated with types."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import softehl
from tests.surface import (
    ROOT,
    Member,
    Place,
    annotated,
    arguments,
    classes,
    definition,
    exports,
    fields,
    lineage,
    names,
    words,
)

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
MODULES = ("kinematics", "quadrature", "shapes")
SECTIONS = ("Parameters", "Attributes", "Returns", "Yields", "Raises", "Notes")
"""Sections of numpydoc, in their order."""
INNER = {
    "protocols, which public classes and users' objects satisfy": {
        *("Engine", "Kinematics", "LinearSolver", "NonlinearProblem", "PointState"),
    },
    "records of a run, which a case of one's own makes": {"Cells", "State", "StepReport"},
    "records between a public class and its own methods": {
        *(
            "Affine",
            "Basis",
            "Call",
            "CellOptions",
            "Constraints",
            "Located",
            "NewtonState",
            "Pattern",
            "PointForm",
            "Step",
        ),
    },
}
"""Classes in annotations that no user makes or keeps."""
UNTYPED = {
    "values of SymPy, which has no types: scalar, list or matrix": {
        *("Element", "Fields", "Law", "Material", "Model", "kinematics", "shapes", "quadrature"),
    },
    "a Result, or the last state of another path: solvers know no results": {"NotConverged"},
    "arrays or mappings at first, arrays once they are checked": {"Problem"},
    "arguments of `solve` or `march`": {"Study.objective", "Study.in_jax", "Study.fit"},
    "numbers, arrays and functions by the page's own names": {"Study.add", "Kernel"},
    "arguments of a kernel by name": {"ElementBlock.given"},
    "its overloads have types": {"page"},
    "parameters and rows of the case's own classes": {"Curve"},
    "values of a stage, by the case's own names": {"Observer.stage"},
    "arrays of JAX, which need not be installed": {"Operation"},
}
"""Public names whose annotations hold Any, and why."""


def shown() -> dict[str, dict[str, str]]:
    """Public path -> options of its directive in docs/api.md."""
    found = {}
    for path, block in re.findall(r"^\.\. auto\w+:: (\S+)\n((?:   .*\n)*)", PAGE, re.MULTILINE):
        found[path] = dict(re.findall(r":([\w-]+): ?(.*)", block))
    return found


def documented() -> Iterator[Member]:
    """Classes and functions of docs/api.md, with the methods that their directives show."""
    places = exports()
    for path, options in shown().items():
        _, name, *rest = path.split(".")
        if name in MODULES:
            found = definition(softehl._MODELLING[name].removesuffix(":"), rest[0])
        else:
            found = places[name]
        assert found is not None, path
        module, node = found
        label = ".".join((name, *rest))
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            yield Member(label, module, node)
        if isinstance(node, ast.ClassDef) and "members" in options:
            yield from methods(label, module, node, options)


def methods(
    label: str, module: str, node: ast.ClassDef, options: dict[str, str]
) -> Iterator[Member]:
    own = {*options["members"].split(", ")} - {""}
    special = {options.get("special-members", "")}
    seen: set[str] = set()
    for where, kind in lineage(module, node):
        for method in kind.body:
            if not isinstance(method, ast.FunctionDef) or method.name in seen:
                continue
            if method.name in (own or special) or not (own or method.name[0] == "_"):
                yield Member(f"{label}.{method.name}", where, method)
            seen.add(method.name)
        if "inherited-members" not in options:
            return


def test_every_public_name_is_documented_under_its_public_path() -> None:
    paths = [path.split(".") for path in shown()]
    assert {path[0] for path in paths} == {"softehl"}
    assert {path[1] for path in paths} == set(softehl.__all__)
    for module in MODULES:
        defined = names(softehl._MODELLING[module].removesuffix(":")).values()
        functions = {node.name for node in defined if isinstance(node, ast.FunctionDef)}
        own = {name for name in functions if not name.startswith("_")}
        assert own <= {path[2] for path in paths if path[1] == module}


def test_classes_in_annotations_of_public_methods_are_public() -> None:
    exported = {
        Place(member.module, member.node.name)
        for member in documented()
        if isinstance(member.node, ast.ClassDef)
    }
    inner = set().union(*INNER.values())
    missed = {
        f"{place.name}: {member.label}({name})"
        for member in documented()
        if not isinstance(member.node, ast.ClassDef)
        for name, annotation in annotated(member)
        for place in classes(member.module, annotation)
        if place not in exported and place.name not in inner
    }
    assert missed == set()


def test_annotations_have_types() -> None:
    allowed = set().union(*UNTYPED.values())
    missed = {
        f"{member.label}({name})"
        for member in documented()
        if not {member.label, member.label.partition(".")[0]} & allowed
        for name, annotation in annotated(member)
        if "Any" in words(annotation)
    }
    assert missed == set()


def sections(text: str) -> dict[str, list[str]]:
    """Section of a docstring -> names that it lists."""
    found: dict[str, list[str]] = {}
    current = ""
    lines = text.split("\n")
    for line, rule in zip(lines, [*lines[1:], ""], strict=True):
        if rule and set(rule) == {"-"}:
            assert len(rule) == len(line), f"{line}: its line has {len(rule)} dashes"
            current = line
            found[current] = []
        elif current and line and not line.startswith((" ", "-")):
            listed, colon, _ = line.partition(" : ")
            found[current] += listed.split(", ") if colon or current == "Raises" else []
            if not colon and listed.startswith("*"):
                found[current].append(listed)
    return found


def faults(member: Member) -> Iterator[str]:
    """Rules of numpydoc that a docstring breaks."""
    node = member.node
    assert isinstance(node, ast.ClassDef | ast.FunctionDef)
    text = ast.get_docstring(node) or ""
    summary, _, rest = text.partition("\n")
    if not summary or not summary[0].isupper() or not summary.endswith("."):
        yield f"the summary is {summary!r}, must be a sentence"
    if rest and not rest.startswith("\n"):
        yield "the summary has more than one line"
    found = sections(text)
    known = [name for name in SECTIONS if name in found]
    if list(found) != known:
        yield f"sections are {list(found)}, must be {known}"
    decorators = {ast.unparse(d).rpartition(".")[2] for d in node.decorator_list}
    if isinstance(node, ast.ClassDef):
        listed = found.get("Parameters", found.get("Attributes", []))
        init = [n for n in node.body if isinstance(n, ast.FunctionDef) and n.name == "__init__"]
        wanted = [name for name, _ in fields(node)] if listed else []
        if "Parameters" in found and init:
            wanted = [argument.arg for argument in arguments(init[0])]
        data = any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)
        if data and fields(node) and not listed:
            yield "its fields are not listed"
        if listed and not set(wanted) <= set(listed):
            yield f"not listed are {sorted(set(wanted) - set(listed))}"
    elif decorators & {"property", "cached_property"}:
        if ": " in summary:
            yield "a colon in the summary of a property is read as its type"
    else:
        stars = {node.args.vararg: "*", node.args.kwarg: "**"}
        wanted = [stars.get(argument, "") + argument.arg for argument in arguments(node)]
        if found.get("Parameters", []) != wanted:
            yield f"parameters are {found.get('Parameters', [])}, must be {wanted}"
        returns = node.returns is not None and ast.unparse(node.returns) != "None"
        if returns and not summary.startswith("Refuse ") and not {"Returns", "Yields"} & set(found):
            yield "the returned value is not described"


def test_docstrings_have_the_form_of_numpydoc() -> None:
    found = [f"{member.label}: {fault}" for member in documented() for fault in faults(member)]
    assert found == [], "\n".join(found)
