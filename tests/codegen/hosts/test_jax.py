"""Target `jax`: the test of its folder, with JAX where it is installed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given

from softehl.codegen.abi import TargetError
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.tools import host_files, model_loader
from tests.codegen.hosts.random_pages import FEW, A, B, K, page, pages
from tests.codegen.hosts.workshop import errors, folder, made
from tests.crossings.pages import learned

ROOT = Path(__file__).parents[3]
PYTHON = os.environ.get("SOFTEHL_JAX", sys.executable)
"""A Python that has JAX."""


def has_jax() -> bool:
    found = subprocess.run([PYTHON, "-c", "import jax"], capture_output=True, check=False)
    return found.returncode == 0


needs_jax = pytest.mark.skipif(not has_jax(), reason="no JAX; SOFTEHL_JAX names a Python with it")


@needs_jax
def test_a_page_with_curves_and_networks(tmp_path: Path) -> None:
    """Its arrays stand in p; derivatives by p are refused."""
    done = made(folder(learned.definition("quad4"), "jax", tmp_path), PYTHON=PYTHON)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "a derivative by arrays is refused" in done.stdout


@needs_jax
@FEW
@given(d=pages())
def test_random_pages(d: Definition, tmp_path_factory: pytest.TempPathFactory) -> None:
    place = folder(d, "jax", tmp_path_factory.mktemp("jax"))
    (place / "patch.json").unlink()  # a random energy need not have a minimum
    done = made(place, PYTHON=PYTHON)
    assert done.returncode == 0, done.stdout + done.stderr
    found = errors(done.stdout)
    assert max(found[:3]) < 1e-13


@needs_jax
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("jax_ops.cc", "u.typed_data() + s * n * kU", "u.typed_data()"),
        ("random_line2_jax.py", '"eij,ej->ei"', '"eji,ej->ei"'),
    ],
)
def test_the_test_of_a_folder_sees_a_fault(name: str, old: str, new: str, tmp_path: Path) -> None:
    folder(page("line2", A**2 * K, A * B, conservative=False), "jax", tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path, PYTHON=PYTHON)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@needs_jax
def test_a_solution_has_the_derivatives_of_its_adjoint(tmp_path: Path) -> None:
    """The folder's last check: by held values, forces and parameters, against differences."""
    (d,) = model_loader.definitions(ROOT / "docs" / "models" / "neo_hooke.py")
    done = made(folder(d, "jax", tmp_path), PYTHON=PYTHON)
    assert "a solution by all, differences" in done.stdout, done.stderr
    assert errors(done.stdout)[-1] < 1e-8


def test_a_page_without_a_tangent_is_refused() -> None:
    m = Model("force", nodes=1, rule=quadrature.point_rule())
    u = m.unknown("u")
    m.potential(u**2)
    m.offer(tasks=["residual"])
    with pytest.raises(TargetError, match="force offers no task tangent, which target jax needs"):
        host_files.files(m.finish(), "jax")


def test_the_module_names_what_the_page_has() -> None:
    texts = host_files.files(page("line2", A**2 * K, A * B, conservative=True), "jax")
    module = texts["random_line2_jax.py"]
    compile(module, "random_line2_jax.py", "exec")
    assert "PARAMETERS = {'k': 'a parameter'}" in module
    assert "random_line2_d_a_old2_op" in texts["jax_ops.cc"]
