"""Models from files outside the repository: found, written, compiled, checked, loaded."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import softehl
from softehl.codegen.tools import kernel_cache, model_loader
from softehl.codegen.tools import user_kernels as cli_files
from softehl.codegen.tools.build import DIGEST, LIBRARY
from softehl.codegen.tools.model_text import ModelFileError
from softehl.codegen.verify import verification
from softehl.runtime.kernels.kernel import ArgumentError, MissingKernelsError, StaleKernelsError

SPRING = """
from softehl import Definition, Model, quadrature

def {name}() -> Definition:
    m = Model("{name}", nodes=1, rule=quadrature.point_rule(), unroll=True, doc="A spring.")
    m.coordinates("X")
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential({energy})
    return m.finish()
"""


def spring(name: str = "spring", energy: str = "k * u**2 / 2") -> str:
    return SPRING.format(name=name, energy=energy)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Every test has a cache of its own, and stands in a folder of its own."""
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "cache"


def model_file(text: str, name: str = "mine.py") -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def run(*arguments: str) -> int:
    return softehl.main(["generate", *arguments])


# ------------------------------------------------------------------------------- finding models


def names(text: str) -> list[str]:
    return [d.name for d in model_loader.definitions(model_file(text))]


def test_annotated_functions_without_arguments_are_models_in_the_order_of_the_file() -> None:
    more = "def with_argument(n) -> Definition: raise SystemError\ndef main(): raise SystemError\n"
    hidden = "def _hidden() -> 'Definition': raise SystemError\n"
    assert names(spring("b") + spring("a") + more + hidden) == ["b", "a"]
    assert names("from __future__ import annotations" + spring("later")) == ["later"]


def test_definitions_and_models_mappings_are_models() -> None:
    assert names(spring("_made").replace("_made", "made") + "x = made()\ndel made\n") == ["made"]
    assert names(spring("a") + spring("b") + "MODELS = {'only': b}\n") == ["b"]
    assert names(spring("a") + spring("b") + "MODELS = [b, a]\n") == ["b", "a"]


def test_imported_models_are_not_those_of_the_file() -> None:
    model_file(spring("theirs"), "theirs.py")
    assert names("from theirs import theirs\n" + spring("mine")) == ["mine"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", r"mine.py has no model: write `def my_model\(\) -> Definition:`"),
        ("def it(): return 1\n", r"has no model: annotate `def it\(\) -> Definition:`"),
        (spring() + "x = spring()\n", "two models are called spring; rename one"),
        (spring().replace('"spring"', '"a-b"'), "mine.py:5: a model is called 'a-b'; use letters"),
        (spring().replace('"spring"', '"a b"'), "mine.py:5: a model is called 'a b'; use letters"),
        ("x = 1\ndef f(:\n", "mine.py:2: invalid syntax"),
        ("x = 1\ny = x / 0\n", "mine.py:2: ZeroDivisionError: division by zero"),
        ("import no_such_thing\n", "mine.py:1: ModuleNotFoundError: No module named 'no_such"),
        (spring(energy="k * q"), "mine.py:9: NameError: name 'q' is not defined"),
        (
            spring(energy="k * (1 / 3)"),
            r"mine.py:9: 0\.3.* is a rounded number; write an exact one",
        ),
        (
            "from softehl import Definition\ndef f() -> Definition: return 3\n",
            "mine.py:2: f gives int, not a",
        ),
        (
            spring().replace("m.finish()", "m"),
            "mine.py:4: spring gives a Model that is not finished, not a Definition: write",
        ),
        (
            spring().replace("    return m.finish()\n", ""),
            "mine.py:4: spring gives NoneType, not a Definition: write",
        ),
        ("import sympy as sp" + spring(energy="k / sp.Integer(0)"), "mine.py:9: zoo is no number"),
        ("import sympy as sp" + spring(energy="k * sp.oo"), "mine.py:9: oo.* is no number"),
        (spring(energy="k / 0"), "mine.py:9: zoo is no number: something is divided by zero"),
        (spring(energy="1 / 0"), "mine.py:9: ZeroDivisionError: division by zero"),
        (
            spring(energy="k if u > 0 else 0"),
            "mine.py:9: a condition on symbols is neither .* write a branch as sp.Piecewise",
        ),
        (
            "import numpy as np" + spring(energy="np.exp(k * u)"),
            r"mine.py:9: np.exp .*: use sp.exp",
        ),
        ("import math" + spring(energy="math.log(k * u)"), r"mine.py:9: math.log .*: use sp.log"),
        ("import numpy as np" + spring(energy="k * np.arctan(u)"), r"np.arctan .*: use sp.atan"),
        (spring(energy="0 if m.define('J', 1 + u) == 1 else 1"), "mine.py:9: J == 1 is neither"),
        (spring().replace("point_rule()", "gauss(4, 7)"), "mine.py:5: .*the dimension is 1, 2"),
        (
            "import sympy as sp" + spring(energy="sp.Derivative(k * u**2, u)"),
            r"mine.py:9: Derivative\(k\*u1\*\*2, u1\) is not carried out: use m.derivative",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line_with_the_line(
    text: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ModelFileError, match=message):
        model_loader.definitions(model_file(text))
    assert run("mine.py") == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("softehl: ")
    assert len(printed.err.splitlines()) == 1
    assert not Path("generated").exists()


def test_files_that_cannot_be_read_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("missing.py") == 2
    assert "cannot read" in capsys.readouterr().err
    Path("binary.py").write_bytes(b"\xff\xfe\x00")
    assert run("binary.py") == 2
    assert "it is not UTF-8 text" in capsys.readouterr().err


# ------------------------------------------------------------------------------- the command line


def test_generate_writes_compiles_and_checks(capsys: pytest.CaptureFixture[str]) -> None:
    model_file(spring("soft") + spring("hard", "k * u**4 / 4"), "models/mine.py")
    assert run("models/mine.py") == 0
    folder = Path("models/generated/mine")
    written = {p.name for p in folder.iterdir()}
    assert written == {
        *("soft.c", "hard.c", "signature.c", "softehl_kernels.h", "manifest.json", LIBRARY, DIGEST)
    }
    printed = capsys.readouterr().out
    assert "7 files in models/generated/mine, 7 of them new or changed" in printed
    rows = [line.split() for line in printed.splitlines()]
    for name in ("soft", "hard"):
        (row,) = [r for r in rows if r[:2] == [name, "energy"]]
        assert int(row[2]) > 0
        assert 0 <= int(row[3]) < 10_000, "nanoseconds"
        assert int(row[4]) == (folder / f"{name}.c").stat().st_size
        assert all(0.0 <= float(v) < 60.0 for v in row[5:7])
        assert all(0.0 <= float(v) < 1e-14 for v in row[7:9])
    before = {p.name: p.stat().st_mtime_ns for p in folder.iterdir()}
    assert run("models/mine.py") == 0
    assert {p.name: p.stat().st_mtime_ns for p in folder.iterdir()} == before
    again = capsys.readouterr().out
    assert "0 of them new or changed" in again
    assert again.count("cached") == 4


def test_a_renamed_model_leaves_nothing_behind_and_files_of_others_are_left_alone(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(str(model_file(spring("old")))) == 0
    assert run(str(model_file(spring("new")))) == 0
    assert {p.name for p in Path("generated/mine").glob("*.c")} == {"new.c", "signature.c"}
    Path("own").mkdir()
    Path("own/solver.c").write_text("int solver;\n")
    capsys.readouterr()
    assert run("mine.py", "--out", "own") == 2
    assert "own holds solver.c, which softehl did not write" in capsys.readouterr().err
    assert [p.name for p in Path("own").iterdir()] == ["solver.c"]


# ------------------------------------------------------------------------------ the tangent check


def test_a_wrong_kernel_is_caught_whichever_task_is_wrong(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The check must fail on C that is wrong: one number is changed in one function at a time."""
    model_file(spring(energy="k * u**3 / 5"))
    definitions, made = kernel_cache.of_files([Path("mine.py")])
    derived = dict(made.files)
    for task in ("energy", "residual", "tangent"):
        text = derived["spring.c"]
        start = text.index(f"softehl_spring_{task}")
        wrong = text[:start] + text[start:].replace("parameters[0]", "1.0000001 * parameters[0]", 1)
        assert wrong != text
        files = {**derived, "spring.c": wrong}
        folder, _ = kernel_cache.compiled(files)
        errors = verification.errors(
            definitions[0], ("energy", "residual", "tangent"), folder / LIBRARY
        )
        assert {t for t, e in errors.items() if e > verification.BOUND} == {task}
        assert errors[task] < 1e-6
        assert cli_files._judge("spring", errors) == 1
        assert f"spring: {task} is off by" in capsys.readouterr().err


def test_a_model_far_from_its_domain_says_what_to_give(capsys: pytest.CaptureFixture[str]) -> None:
    energy = "m.integral('Pi', sp.log(m.define('slack', k - 40)) * u**2)"
    text = "import sympy as sp" + spring(energy=energy)
    model_file(text)
    assert run("mine.py") == 2
    printed = capsys.readouterr().err
    assert "spring cannot be checked: log(.. slack ..) has no real value" in printed
    assert "m.example(k=...)" in printed
    model_file(text.replace("    return", "    m.example(k=50)\n    return"))
    assert run("mine.py") == 0
    model_file(text.replace("    return", "    m.example(q=50)\n    return"))
    assert run("mine.py") == 2
    assert "example: q is no argument of spring" in capsys.readouterr().err


def test_a_kernel_that_cannot_be_checked_does_not_hide_the_others(
    capsys: pytest.CaptureFixture[str],
) -> None:
    model_file("import sympy as sp" + spring("far", "sp.log(k - 40) * u**2") + spring("near"))
    assert run("mine.py") == 2
    printed = capsys.readouterr()
    rows = [line.split() for line in printed.out.splitlines()]
    (near,) = [r for r in rows if r[:2] == ["near", "energy"]]
    assert all(0.0 <= float(v) < 1e-14 for v in near[7:9])
    (far,) = [r for r in rows if r[:2] == ["far", "energy"]]
    assert far[7:9] == ["-", "-"]
    assert printed.err.startswith("softehl: far cannot be checked: log")
    assert len(printed.err.splitlines()) == 1


def test_a_value_that_is_not_a_number_names_its_quantity(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """An energy with a value, but without a derivative where the check looks: sqrt at zero."""
    root = "m.define('root', sp.sqrt(m.define('nothing', sp.Min(u, 10) - sp.Max(u, -10))))"
    model_file("import sympy as sp" + spring(energy=f"{root} * k + u**2"))
    assert run("mine.py") == 1
    printed = capsys.readouterr().err
    for task in ("residual", "tangent"):
        assert f"spring: {task} is not a number: pow(.. nothing ..) has none" in printed


# ------------------------------------------------------------------------------------- loading


def test_a_model_file_is_loaded_and_follows_its_text(capsys: pytest.CaptureFixture[str]) -> None:
    X, u = np.zeros((2, 1)), np.array([[2.0], [3.0]])
    path = model_file(spring())
    kernel = softehl.load_kernel("mine.py")
    np.testing.assert_array_equal(kernel.residual(X, u, parameters={"k": 10.0}), 10.0 * u)
    assert softehl.load_kernel(path) is kernel
    model_file(spring(energy="2 * k * u**2"))
    other = softehl.load_kernel("mine.py")
    np.testing.assert_array_equal(other.residual(X, u, parameters={"k": 10.0}), 40.0 * u)
    np.testing.assert_array_equal(kernel.residual(X, u, parameters={"k": 10.0}), 10.0 * u)
    with pytest.raises(ArgumentError, match=r"dofs has shape \(2, 2\), must be \(2, 1\)"):
        kernel.residual(X, np.zeros((2, 2)), parameters=[1.0])
    with pytest.raises(ArgumentError, match="dofs holds complex128, must be real numbers"):
        kernel.residual(X, np.full((2, 1), 1j), parameters=[1.0])


def test_definitions_shipped_names_and_folders_are_loaded() -> None:
    (definition,) = model_loader.definitions(model_file(spring()))
    kernel = softehl.load_kernel(definition)
    assert kernel.name == "spring"
    assert softehl.load_kernel("solid_q4").name == "solid_q4"
    assert run("mine.py") == 0
    again = softehl.load_kernel("generated/mine")
    assert again.signature == kernel.signature
    source = Path("generated/mine/spring.c")
    source.write_text(source.read_text().replace("0.5", "0.6"))
    with pytest.raises(StaleKernelsError, match="mine/ has changed since it was loaded"):
        softehl.load_kernel("generated/mine")
    shutil.copytree("generated/mine", "edited")
    with pytest.raises(StaleKernelsError, match=r"other sources .* run `softehl generate`"):
        softehl.load_kernel("edited")
    with pytest.raises(MissingKernelsError, match="no kernel 'nothing'; there are solid_q4"):
        softehl.load_kernel("nothing")


# -------------------------------------------------------------------------------- pages of fields


def test_a_local_iteration_without_a_solution_asks_for_an_example(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The oracle takes 200 steps, the kernel 25 at most: here one, which is not enough."""
    local = "m.implicit('s', lambda s: s**3 + s - k - u, start=5, iterations=ITERATIONS)"
    text = spring(energy=f"{local} ** 2")
    model_file(text.replace("ITERATIONS", "1"))
    assert run("mine.py") == 2
    printed = capsys.readouterr().err
    assert "its local iteration finds no solution at random states" in printed
    assert "m.example(k=...)" in printed
    model_file(text.replace("ITERATIONS", "25"))
    assert run("mine.py") == 0
