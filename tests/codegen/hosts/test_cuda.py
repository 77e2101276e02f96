"""Target `cuda`: the test of its folder on the processor, and in JAX where it is installed."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

import softehl
from softehl.codegen.abi import TargetError
from softehl.codegen.language.definition import Definition
from softehl.codegen.models import ALL
from softehl.codegen.tools import host_files
from tests.codegen.hosts.test_jax import PYTHON, has_jax
from tests.codegen.hosts.workshop import errors, folder, made
from tests.device.test_device_kernels import page


def definition(law: str, cell: str) -> Definition:
    made_page: Any = page(law)
    found: Definition = made_page.definition(cell)
    return found


SLOW = [
    ("neo_hooke", "hex27"),
    ("plastic", "hex8"),
    ("advection", "quad9"),
    ("convection", "quad9"),
]


@pytest.mark.parametrize(
    ("law", "cell"),
    [("springs", "quad4"), *(pytest.param(*c, marks=pytest.mark.slow) for c in SLOW)],
)
def test_the_folder(law: str, cell: str, tmp_path: Path) -> None:
    d = definition(law, cell)
    done = made(folder(d, "cuda", tmp_path), PYTHON=PYTHON if has_jax() else sys.executable)
    assert done.returncode == 0, done.stdout + done.stderr
    found = errors(done.stdout)
    assert len(found) >= 10
    assert max(found) < 1e-13


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "file", "old", "new"),
    [
        ("springs", ".cu", "const V w = det *", "const V w = 1.001 * det *"),
        ("springs", "_cupy.py", "NODE_ORDER = [0, 1, 3, 2]", "NODE_ORDER = [0, 1, 2, 3]"),
        ("advection", "_cupy.py", '"product_transposed" if', '"product_moduli" if'),
    ],
)
def test_a_wrong_folder_is_noticed(law: str, file: str, old: str, new: str, tmp_path: Path) -> None:
    place = folder(definition(law, "quad4"), "cuda", tmp_path)
    path = place / f"{law}_quad4{file}"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    assert made(place, PYTHON=sys.executable).returncode != 0


def test_what_it_does_not_hold() -> None:
    with pytest.raises(TargetError, match="is no page of fields"):
        host_files.files(ALL["solid_q4"](), "cuda")

    @softehl.page
    def simplex(m: Any) -> None:
        m.minimise(m.grad(m.scalar("T")).norm() ** 2)

    made_page: Any = simplex
    with pytest.raises(TargetError, match="a device needs quadrilaterals or hexahedra"):
        host_files.files(made_page.definition("tri3"), "cuda")
