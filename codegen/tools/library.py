"""Library of elements and laws by name: one model file each, with its source and benchmark.

A file NAME.py defines the page, element or material NAME. The first line of its docstring is a
summary; lines `Cells:`, `Source:` and `Benchmark:` follow. A user may copy a file and change it.
"""

from __future__ import annotations

import ast
import difflib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from softehl.errors import SoftehlError

FOLDER = Path(__file__).resolve().parents[1] / "models" / "library"
LONGEST = 80
"""Lines of a file at most."""
_DECLARATIONS = ("vector", "scalar", "nodal_unknowns", "internal", "unknown")


class LibraryError(SoftehlError, ValueError):
    """The library has no such entry; the message names those that there are."""


@dataclass(frozen=True)
class Entry:
    """Element or law of the library.

    kind: "element" or "material". summary, cells, source, benchmark: of its docstring. unknowns:
    names of its unknowns. parameters: name -> meaning with unit, of data and arrays too.
    """

    name: str
    path: Path
    kind: str
    summary: str
    cells: str
    source: str
    benchmark: str
    unknowns: tuple[str, ...]
    parameters: dict[str, str]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of cells that it is for; empty for any."""
        return () if self.cells in ("", "any") else tuple(self.cells.split(", "))


_MU, _KAPPA = {"mu": "shear modulus [MPa]"}, {"kappa": "bulk modulus [MPa]"}
_ELASTIC = {"E": "Young's modulus [MPa]", "nu": "Poisson's ratio, below 0.5"}
_OGDEN = {
    name: meaning
    for p in (1, 2, 3)
    for name, meaning in (
        (f"mu_{p}", f"modulus of term {p} [MPa]"),
        (f"alpha_{p}", f"exponent of term {p}"),
    )
}
_BUILT_IN: tuple[tuple[str, str, str, dict[str, str]], ...] = (
    ("hooke", "Linear elasticity at small strain.", "Hooke (1678)", _ELASTIC),
    ("saint_venant", "Linear in Green's strain.", "Kirchhoff (1852)", _ELASTIC),
    ("neo_hooke", "mu / 2 (I1bar - 3).", "Treloar (1943)", _MU | _KAPPA),
    (
        "mooney_rivlin",
        "mu_1 / 2 (I1bar - 3) + mu_2 / 2 (I2bar - 3).",
        "Mooney (1940); Rivlin (1948)",
        dict.fromkeys(("mu_1", "mu_2"), "elastic parameter [MPa]") | _KAPPA,
    ),
    (
        "yeoh",
        "A cubic in I1bar - 3.",
        "Yeoh (1993), Rubber Chem. Technol. 66, 754-771",
        {f"c_{k}": f"coefficient of (I1bar - 3)^{k} [MPa]" for k in (1, 2, 3)} | _KAPPA,
    ),
    (
        "gent",
        "Chains that lock.",
        "Gent (1996), Rubber Chem. Technol. 69, 59-61",
        _MU | {"J_m": "limit of I1bar - 3 where the chains lock"} | _KAPPA,
    ),
    (
        "arruda_boyce",
        "Eight chains, five terms.",
        "Arruda and Boyce (1993), JMPS 41, 389-412",
        {"mu": "modulus of the chains [MPa]", "lambda_m": "stretch at which they lock"} | _KAPPA,
    ),
    (
        "ogden",
        "Three terms in principal stretches.",
        "Ogden (1972), Proc. R. Soc. A 326, 565-584",
        _OGDEN | _KAPPA,
    ),
)


@cache
def built_in() -> dict[str, Entry]:
    """The laws of `codegen.models.material_elements` by name: no files of their own."""
    path, benchmark = FOLDER.parent / "material_elements.py", "bar in tension, nominal stress"
    return {
        name: Entry(name, path, "material", summary, "", source, benchmark, (), parameters)
        for name, summary, source, parameters in _BUILT_IN
    }


@cache
def entries() -> dict[str, Entry]:
    """All entries by name; the files are read, not run."""
    paths = sorted(FOLDER.glob("[a-z]*.py"))
    return {path.stem: _entry(path) for path in paths}


def entry(name: str, kind: str) -> Entry:
    """The entry of a name and kind; capitals, hyphens and spaces do not count.

    Raises LibraryError.
    """
    plain, candidate = _plain(name), _candidate(name)
    if candidate is not None and candidate.kind == kind:
        return candidate
    names = [e.name for e in entries().values() if e.kind == kind]
    close = difflib.get_close_matches(plain, names, n=2)
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    if candidate is not None:
        hint = f"{plain} is a{'n' if candidate.kind == 'element' else ''} {candidate.kind}; "
    raise LibraryError(f"no {kind} {name!r} in the library: {hint}softehl elements lists them")


def has(name: str, kind: str) -> bool:
    """True if the library has an entry of this name and kind; no other file is read."""
    candidate = _candidate(name)
    return candidate is not None and candidate.kind == kind


def _plain(name: str) -> str:
    return "_".join(name.lower().replace("-", " ").replace("_", " ").split())


def _candidate(name: str) -> Entry | None:
    """The entry of a name, of any kind."""
    path = FOLDER / f"{_plain(name)}.py"
    return _entry(path) if _plain(name).isidentifier() and path.is_file() else None


def text_of(name: str) -> str:
    """The model file of an element or law, by its name.  Raises LibraryError."""
    if name in built_in():
        raise LibraryError(f"{name} is built in and has no file; start from that of hencky")
    kind = "material" if has(name, "material") else "element"
    return entry(name, kind).path.read_text(encoding="utf-8")


def print_list() -> None:
    """Print all entries, one below the other."""
    for kind, call in (("element", "element"), ("material", "material")):
        print(f"{kind}s: study.add(name, {call}=...)\n")
        for e in (e for e in (entries() | built_in()).values() if e.kind == kind):
            print(f"{e.name}: {e.summary}")
            rows = {
                "cells": e.cells,
                "unknowns": ", ".join(e.unknowns),
                "parameters": "; ".join(f"{k}, {v}" for k, v in e.parameters.items()),
                "source": e.source,
                "benchmark": e.benchmark,
            }
            for label, text in rows.items():
                if text:
                    print(f"    {label + ':':<12} {text}")
            print()


@cache
def _entry(path: Path) -> Entry:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    doc = (ast.get_docstring(tree) or "").strip()
    summary, _, body = doc.partition("\n")
    notes = {"Cells": "", "Source": "", "Benchmark": ""}
    last = ""
    for line in body.splitlines():
        label, colon, text = line.partition(":")
        if colon and label in notes:
            last, notes[label] = label, text.strip()
        elif last and line.strip():
            notes[last] += f" {line.strip()}"
        else:
            last = ""
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == path.stem)
    decorators = " ".join(ast.unparse(d) for d in function.decorator_list)
    unknowns, parameters = _arguments(tree)
    return Entry(
        path.stem,
        path,
        "material" if "material" in decorators else "element",
        summary,
        notes["Cells"],
        notes["Source"],
        notes["Benchmark"],
        unknowns,
        parameters,
    )


def _arguments(tree: ast.Module) -> tuple[tuple[str, ...], dict[str, str]]:
    """Names of unknowns, and arguments with their meanings, by the calls of a page."""
    unknowns, parameters = [], {}
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        texts = [a.value for a in node.args if isinstance(a, ast.Constant)]
        if node.func.attr in _DECLARATIONS:
            unknowns += [t for t in texts if isinstance(t, str)]
        elif node.func.attr in ("parameters", "data"):
            for k in node.keywords:
                if k.arg and isinstance(k.value, ast.Constant):
                    parameters[k.arg] = str(k.value.value)
        elif node.func.attr == "nodal_data":
            meaning = next((ast.literal_eval(k.value) for k in node.keywords), "")
            parameters |= {t: f"{meaning}, at nodes" for t in texts if isinstance(t, str)}
        elif node.func.attr in ("array", "table"):
            parameters |= {t: "several numbers" for t in texts[:1] if isinstance(t, str)}
    return tuple(dict.fromkeys(unknowns)), parameters
