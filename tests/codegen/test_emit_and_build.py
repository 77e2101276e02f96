"""Throw-away models all the way to machine code; what a failing or stale build says."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import sympy as sp

from softehl.codegen.abi import BuildError
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build, shipped_kernels
from softehl.runtime.kernels.kernel import (
    MissingKernelsError,
    StaleKernelsError,
    load_kernel,
)
from tests.codegen.workshop import compiled, write

# ----------------------------------------------------------------------------------- the values


# -------------------------------------------------------------------------- outputs, their place


def fields_model(**fields: str) -> Definition:
    m = Model("places", nodes=1, rule=quadrature.gauss(2, 1))
    x = m.unknown("x")
    (xi,) = m.point()
    total = m.integral("total", x * xi**2)
    m.potential(total)
    known = {"x": x, "xi": xi, "total": total, "late": total * xi, "two": sp.Integer(2)}
    m.fields(**{name: known[value] for name, value in fields.items()})
    return m.finish()


# ------------------------------------------------------------------------------------- the text


@pytest.mark.slow
def test_shipped_c_is_plain_c11_without_warnings(tmp_path: Path) -> None:
    """Every warning the compiler knows of that is not a matter of taste, under two dialects."""
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, tmp_path)
    build.build(tmp_path, extra=(*build.STRICT, "-Wpedantic", "-Wconversion", "-Wshadow", "-O0"))
    # a C compiler that knows no restrict in C++ is no matter: C17 must do as well
    build.build(tmp_path, extra=(*build.STRICT, "-std=c17", "-O0"))


def test_documentation_cannot_end_the_comment(tmp_path: Path) -> None:
    m = Model("commented", nodes=1, rule=quadrature.point_rule(), doc="kappa*/mu ratio")
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness [N*/mm]")
    m.potential(k * x**2)
    compiled(m.finish(), tmp_path)


# ------------------------------------------------------------------------------------- the build


def test_a_failed_build_shows_the_command_and_the_words_of_the_compiler(tmp_path: Path) -> None:
    (tmp_path / "broken.c").write_text("int f(void) { return no_such_name; }\n")
    with pytest.raises(BuildError) as failed:
        build.build(tmp_path, extra=build.STRICT)
    message = str(failed.value)
    assert "the C compiler failed" in message
    assert "broken.c" in message
    assert all(flag in message for flag in (*build.STRICT, "-std=c11"))
    assert "no_such_name" in message
    assert [p.name for p in tmp_path.iterdir()] == ["broken.c"], "nothing is left behind"


def test_warnings_are_errors_for_us_and_nothing_to_users(tmp_path: Path) -> None:
    (tmp_path / "sloppy.c").write_text("int f(int unused) { return 0; }\n")
    with pytest.raises(BuildError, match="unused"):
        build.build(tmp_path, extra=build.STRICT)
    build.build(tmp_path)


def test_a_missing_compiler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(BuildError, match=r"'no-such-compiler' is not on the PATH.* set CC"):
        build.build(tmp_path)
    assert list(tmp_path.iterdir()) == []
    before = {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()}
    assert shipped_kernels.main() == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("softehl: no C compiler: 'no-such-compiler' is not on the PATH")
    assert len(printed.err.splitlines()) == 1
    assert {p.name: p.stat().st_mtime_ns for p in build.GENERATED.iterdir()} == before


def test_a_failed_build_keeps_the_old_library(tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    assert set(build.build(tmp_path)) == {"places", "signature"}
    library = tmp_path / build.LIBRARY
    before = library.read_bytes()
    (tmp_path / "places.c").write_text("syntax error\n")
    with pytest.raises(BuildError):
        build.build(tmp_path)
    assert library.read_bytes() == before
    assert not [p for p in tmp_path.iterdir() if p.suffix == ".so" and p != library]


# ------------------------------------------------------------------------------ stale and missing


def test_a_library_that_was_not_built(tmp_path: Path) -> None:
    with pytest.raises(MissingKernelsError, match=r"manifest\.json is missing: run"):
        load_kernel("places", tmp_path)
    write(fields_model(a="xi"), tmp_path / "")
    other = tmp_path / "other"
    other.mkdir()
    write(fields_model(a="xi"), other)
    with pytest.raises(MissingKernelsError, match=r"not built: run `softehl generate`"):
        load_kernel("places", other)


@pytest.mark.parametrize("changed", ["places.c", "softehl_kernels.h", "new.c"])
def test_a_stale_library_is_refused(changed: str, tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    build.build(tmp_path, extra=("-O0",))
    with (tmp_path / changed).open("a", encoding="utf-8") as file:
        file.write("\n")
    with pytest.raises(StaleKernelsError, match=r"was built from other sources .*softehl generate"):
        load_kernel("places", tmp_path)


def test_the_remedy_helps_in_the_same_process(tmp_path: Path) -> None:
    write(fields_model(a="xi"), tmp_path)
    build.build(tmp_path, extra=("-O0",))
    (tmp_path / "new.c").write_text("int new;\n")
    with pytest.raises(StaleKernelsError):
        load_kernel("places", tmp_path)
    build.build(tmp_path, extra=("-O0",))
    assert load_kernel("places", tmp_path).unknowns == ("x",)
