"""Targets: which files; several lanes, one lane and scalar C say the same."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.codegen import pipeline
from softehl.codegen.abi import Target
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, cli, output_files
from softehl.runtime.kernels.kernel import Kernel, load_kernel
from tests.codegen.element_states import Case, all_cases

FAMILIES = ("solid_taylor", "contact", "axial_spring")
CASES = [c for c in all_cases() if c.family in FAMILIES]


@pytest.fixture(scope="module")
def scalar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Kernels of target `scalar`."""
    directory = tmp_path_factory.mktemp("scalar")
    kernels = [pipeline.compile_model(ALL[name](), Target.SCALAR) for name in FAMILIES]
    for name, text in output_files.files(kernels).items():
        (directory / name).write_text(text, encoding="utf-8")
    build.build(directory, extra=(*build.STRICT, "-O1"))
    return directory


@pytest.fixture(scope="module")
def one_lane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped C as a compiler without vector extensions reads it."""
    directory = tmp_path_factory.mktemp("one_lane")
    for name in (
        *(f"{f}.c" for f in FAMILIES),
        "signature.c",
        "softehl_kernels.h",
        "manifest.json",
    ):
        shutil.copy(build.GENERATED / name, directory)
    build.build(directory, extra=(*build.STRICT, "-Wpedantic", "-O1", "-DSOFTEHL_LANES=1"))
    return directory


def values(kernel: Kernel, case: Case) -> list[Any]:
    """All that a kernel says about a batch of three elements."""
    X, u, a = (np.tile(v, (3, 1)) for v in (case.coordinates, case.dofs, case.data))
    given: dict[str, Any] = {"data": a, "parameters": case.parameters}
    out = [kernel.residual(X, u, **given), *kernel.tangent(X, u, **given)]
    return out + ([kernel.energy(X, u, **given)] if "energy" in kernel.tasks else [])


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.family}: {c.label}")
@pytest.mark.parametrize("other", ["scalar", "one_lane"])
def test_targets_agree(case: Case, other: str, request: pytest.FixtureRequest) -> None:
    directory: Path = request.getfixturevalue(other)
    found = values(load_kernel(case.family, directory), case)
    expected = values(load_kernel(case.family), case)
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * np.abs(b).max())


def test_scalar_c_is_the_shipped_text_with_one_lane(scalar: Path) -> None:
    for name in FAMILIES:
        shipped = (build.GENERATED / f"{name}.c").read_text()
        plain = (scalar / f"{name}.c").read_text()
        assert plain.replace("#define SOFTEHL_LANES 1\n", "") == shipped
        assert plain != shipped


# ------------------------------------------------------------------------------- the command line


def test_generate_writes_cells_for_dolfinx(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "ALL", {k: ALL[k] for k in ("contact", "film")})
    assert cli.generate(target="ufcx", out=tmp_path / "cells") == 0
    printed = capsys.readouterr()
    assert "left out: film interpolates p" in printed.err
    assert "files of target ufcx in " in printed.out
    assert [p.name for p in (tmp_path / "cells").iterdir()] == ["contact_ufcx.c"]


def test_generate_writes_a_complete_folder_of_scalar_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli, "ALL", {"contact": ALL["contact"]})
    assert cli.generate(target="scalar", out=tmp_path) == 0
    build.build(tmp_path, extra=("-O0",))
    assert load_kernel("contact", tmp_path).tasks == ("residual", "tangent", "pseudo_load")
