"""What a model file runs is what its key in the cache says: neighbours, tables, equal names."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softehl
from softehl.codegen.tools import kernel_cache, model_loader
from softehl.runtime.kernels.kernel import Kernel

SPRING = """
from softehl import Definition, Model, quadrature

def spring() -> Definition:
    m = Model("spring", nodes=1, rule=quadrature.point_rule(), unroll=True, doc="A spring.")
    m.coordinates("X")
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential({energy})
    return m.finish()
"""


def write(name: str, text: str) -> Path:
    path = Path(name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def model(first: str, energy: str = "FACTOR * k * u", name: str = "mine.py") -> Path:
    return write(name, first + SPRING.format(energy=energy))


def said(path: Path) -> str:
    """What the model of a file says, by its digest."""
    (definition,) = model_loader.definitions(path)
    return kernel_cache.fingerprint(definition)


def factor(value: int) -> str:
    """What a model says that has this factor in its text."""
    return said(model(f"FACTOR = {value}\n", name="expected/mine.py"))


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of its own, first on the path of imports as that of a script is, and a cache."""
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.syspath_prepend(tmp_path / "here")
    before = set(sys.modules)
    yield tmp_path / "here"
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) or name.startswith(("pack", "consts")):
            del sys.modules[name]


def imported(name: str) -> ModuleType:
    __import__(name)
    return sys.modules[name]


@pytest.mark.parametrize(
    ("line", "files"),
    [
        ("from consts import FACTOR\n", ("consts",)),
        ("from between import FACTOR\n", ("between", "consts")),
        ("from pack.consts import FACTOR\n", ("pack.consts",)),
        ("from bare.consts import FACTOR\n", ("bare.consts",)),
        ("from pack import FACTOR\n", ("pack", "pack.consts")),
        ("import importlib\nFACTOR = importlib.import_module('consts').FACTOR\n", ("consts",)),
    ],
)
def test_neighbours_are_read_anew_whoever_has_imported_them(
    line: str, files: tuple[str, ...]
) -> None:
    write("between.py", "from consts import FACTOR\n")
    write("pack/__init__.py", "from .consts import FACTOR\n")
    for text in ("FACTOR = 3\n", "FACTOR = 5\n"):  # of one length, within one second
        for name in ("consts.py", "pack/consts.py", "bare/consts.py"):
            write(name, text)
        if text == "FACTOR = 3\n":
            before = [imported(name) for name in files]
        path = model(line)
        assert said(path) == factor(int(text[-2]))
    assert [sys.modules[name] for name in files] == before
    assert before[-1].FACTOR == 3, "the script keeps what it has imported"


def test_each_folder_has_neighbours_of_its_own() -> None:
    for value in (3, 5):
        write(f"folder_{value}/consts.py", f"FACTOR = {value}\n")
    write("consts.py", "FACTOR = 7\n")
    imported("consts")
    for value in (5, 3, 5):
        path = model("from consts import FACTOR\n", name=f"folder_{value}/mine.py")
        assert said(path) == factor(value)


def test_installed_packages_stay_where_an_environment_lies_in_the_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    installed = write(".venv/lib/site-packages/consts_installed.py", "FACTOR = 3\n").parent
    monkeypatch.syspath_prepend(installed)
    path = model("from consts_installed import FACTOR\n")
    assert said(path) == factor(3)
    before = sys.modules["consts_installed"]
    assert said(path) == factor(3)
    assert sys.modules["consts_installed"] is before


def residual(kernel: Kernel) -> float:
    return float(kernel.residual(np.zeros((1, 1)), np.ones((1, 1)), parameters=[1.0])[0, 0])


def test_a_table_that_a_model_reads_is_in_its_key(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model("from pathlib import Path\nFACTOR = int(Path('table.txt').read_text())\n")
    found = []
    for value in (3, 5, 3):
        write("table.txt", f"{value}\n")
        found.append(residual(softehl.load_kernel("mine.py")))
    assert found == [3.0, 5.0, 3.0]
    runs = []
    monkeypatch.setattr(model_loader, "definitions_and_inputs", lambda *a: runs.append(a))
    assert residual(softehl.load_kernel("mine.py")) == 3.0
    assert runs == [], "nothing has changed since it was stored"
    (place / "table.txt").unlink()
    with pytest.raises(TypeError):  # the model is run again: `definitions` gives nothing here
        softehl.load_kernel("mine.py")
    assert len(runs) == 1


def test_what_the_process_has_of_another_folder_is_not_stored(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write("../elsewhere/consts_elsewhere.py", "FACTOR = 3\n")
    monkeypatch.syspath_prepend(place.parent / "elsewhere")
    imported("consts_elsewhere")
    other = write("../elsewhere/consts_elsewhere.py", "FACTOR = 5\n")
    os.utime(
        other, (0, 0)
    )  # Python takes a text of the same second and size for that of its bytecode
    path = model("from consts_elsewhere import FACTOR\n")
    assert residual(softehl.load_kernel(path)) == 3.0, "what this process has imported"
    del sys.modules["consts_elsewhere"]
    assert residual(softehl.load_kernel(path)) == 5.0


def test_what_ran_another_text_than_the_key_has_is_not_stored() -> None:
    edit = (
        "from pathlib import Path\n"
        "if not Path('done').exists(): Path('consts.py').write_text('FACTOR = 5\\n')\n"
    )
    path = model(edit + "from consts import FACTOR\n")
    write("consts.py", "FACTOR = 3\n")
    assert residual(softehl.load_kernel(path)) == 5.0, "as a script"
    write("consts.py", "FACTOR = 3\n")
    write("done", "")
    assert residual(softehl.load_kernel(path)) == 3.0


def test_a_page_is_what_it_closes_over() -> None:
    factor = 3

    @softehl.page
    def flow(m: object) -> None:
        T = m.scalar("T")  # type: ignore[attr-defined]
        m.minimise(factor * m.grad(T).dot(m.grad(T)))  # type: ignore[attr-defined]

    X, T = np.array([[0.0, 1.0]]), np.array([[0.0, 1.0]])
    three = softehl.load_kernel(flow, cell="line2").energy(X, T)
    factor = 6
    six = softehl.load_kernel(flow, cell="line2").energy(X, T)
    np.testing.assert_allclose([three[0], six[0]], [3.0, 6.0], rtol=1e-15)


def test_threads_run_models_one_at_a_time() -> None:
    for value in (1, 2, 3, 4):
        write(f"folder_{value}/consts.py", f"import time\ntime.sleep(0.02)\nFACTOR = {value}\n")
        model("from consts import FACTOR\n", name=f"folder_{value}/mine.py")
    write("consts.py", "FACTOR = 7\n")
    before = imported("consts")
    paths = [Path(f"folder_{value}/mine.py") for value in (1, 2, 3, 4) * 2]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(said, paths)) == [factor(value) for value in (1, 2, 3, 4) * 2]
    assert sys.modules["consts"] is before
