"""The public surface: everything exported is documented under its public path."""

from __future__ import annotations

import ast
import re

import softehl
from tests.surface import ROOT, names

PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")


def test_every_public_name_is_documented_under_its_public_path() -> None:
    shown = re.findall(r"^\.\. auto\w+:: (\S+)$", PAGE, re.MULTILINE)
    assert {name.partition(".")[0] for name in shown} == {"softehl"}
    inner = [name.split(".")[1:] for name in shown]
    assert {path[0] for path in inner} == set(softehl.__all__)
    for module in ("kinematics", "quadrature", "shapes"):
        defined = names(softehl._MODELLING[module].removesuffix(":")).values()
        functions = {node.name for node in defined if isinstance(node, ast.FunctionDef)}
        public = {name for name in functions if not name.startswith("_")}
        assert public <= {path[1] for path in inner if path[0] == module}
