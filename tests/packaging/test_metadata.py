"""What the package says that it needs is what its rooms import."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import softehl

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = {
    **{"distributed": "cluster", "pypardiso": "fast", "petsc4py": "mpi", "mpi4py": "mpi"},
    "slepc4py": "mpi",
    "ezdxf": "cad",
    **dict.fromkeys(("bokeh", "jinja2", "openpyxl"), "report"),
    **dict.fromkeys(("panel", "panel_material_ui", "pandas", "tornado"), "app"),
    "pyamg": "amg",
    "pyvista": "plot",
    **dict.fromkeys(("cupy", "cupyx"), "cuda"),
}
DISTRIBUTION = {"PIL": "pillow"}
BROUGHT = {
    **{"petsc4py": "dolfinx-solver-real", "mpi4py": "dolfinx-solver-real"},
    "slepc4py": "dolfinx-solver-real",
    **{"tornado": "panel", "panel_material_ui": "panel-material-ui"},
    **dict.fromkeys(("cupy", "cupyx"), "cupy-cuda12x"),
}
"""Packages that come with another one."""


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[\s<>=!;\[]", r, maxsplit=1)[0] for r in requirements}


def imported(folder: Path) -> Iterator[str]:
    """The top-level packages of others that the files of a folder import."""
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                found = [node.module or ""]
            yield from (name.partition(".")[0] for name in found)


def foreign(*rooms: str) -> set[str]:
    every = {name for room in rooms for name in imported(ROOT / room)}
    every = {DISTRIBUTION.get(name, name) for name in every}
    return every - sys.stdlib_module_names - {"softehl"}


def test_what_solving_imports_is_what_the_package_needs() -> None:
    found = foreign("runtime", "cases", "generated") | {"click", "filelock"}  # of src/softehl
    base = names(PROJECT["dependencies"])
    assert found - set(OPTIONAL) == base
    for package in found & set(OPTIONAL):
        extra = PROJECT["optional-dependencies"][OPTIONAL[package]]
        assert BROUGHT.get(package, package) in names(extra)


def test_deriving_needs_one_extra_more() -> None:
    found = foreign("codegen") - names(PROJECT["dependencies"])
    assert found == names(PROJECT["optional-dependencies"]["generate"])
    assert "softehl" in names(PROJECT["optional-dependencies"]["dev"])  # [cluster,generate]


def test_there_is_an_extra_for_each_purpose() -> None:
    wanted = {"amg", "benchmarks", "cad", "cluster", "dev", "docs", "fast", "generate", "mpi"}
    wanted |= {"app", "compiler", "cuda", "hosts", "plot", "report"}
    assert set(PROJECT["optional-dependencies"]) == wanted


def test_the_version_is_that_of_the_changelog_and_the_citation() -> None:
    changes = re.findall(
        r"^## \[([\d.]+)\] - (\S+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE
    )
    cited = dict(
        re.findall(r"^([\w-]+): (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    )
    assert changes[0] == (softehl.__version__, cited["date-released"])
    assert cited["version"] == softehl.__version__
