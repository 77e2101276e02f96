"""The walls between the rooms: who may import what, and what solving never loads."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import softehl

ROOT = Path(__file__).parents[1]
ROOMS = ("codegen", "generated", "runtime", "cases")
OURS = {*ROOMS, "tests", "benchmarks"}

ALLOWED = {
    "codegen": {"codegen"},
    "generated": {"generated"},
    "runtime": {"runtime", "generated"},
    "cases": {"cases", "runtime"},
}
ORDER = {
    "codegen": (
        *(
            "abi",
            "c_compiler",
            "external_function",
            "graph",
            "elements",
            "language",
            "derive",
            "optimise",
            "emit",
        ),
        *("verify", "pipeline", "hosts", "models", "tools"),
    ),
    "runtime": (
        *("arrays io mpi suggestions", "kernels", "mesh", "solve", "discretisation", "contact"),
        *("definition", "equations", "sensitivity", "results", "device", "parallel"),
        *("analyses", "fit", "study"),
    ),
    "cases": ("harness", "seal", "oring slider cycle", "paper", "shipped", "app", "cli document"),
    "cases/seal": (
        *("meshing", "correctors", "gland", "section", "equations", "states"),
        *("solve", "sensitivity", "cycle", "report"),
    ),
}
"""Folders and files of a room, each of which imports only those before it; some are one level."""
PENDING: dict[str, str] = {}
"""Rooms that are still being put in order, and why."""
SOLVERS = sorted((ROOT / "runtime" / "solve").rglob("*.py"))
NOT_FOR_SOLVERS = ("runtime.mesh", "runtime.discretisation", "cases", "codegen")
HEAVY = ("sympy", "mpmath", "jax")


def imports_of(source: str) -> Iterator[str]:
    """Every module that a file names in an import statement, also inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute, by room"
            assert node.module is not None
            yield node.module
            # `from runtime import mesh` imports softehl.runtime.mesh.mesh
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def names_for_importlib(source: str) -> Iterator[str]:
    """Every string that a file gives to `import_module`."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            texts = (
                n.value
                for argument in node.args
                for n in ast.walk(argument)
                if isinstance(n, ast.Constant) and isinstance(n.value, str)
            )
            yield from texts


def files_of(room: str) -> list[Path]:
    return sorted((ROOT / room).rglob("*.py"))


def breaches(room: str, source: str) -> set[str]:
    """The rooms of ours that a file of `room` imports and must not."""
    every = [*imports_of(source), *names_for_importlib(source)]
    names = [name.removeprefix("softehl.") for name in every]
    return {name.split(".")[0] for name in names} & (OURS - ALLOWED[room])


def unit_of(room: str, path: Path) -> str:
    """The folder or file at the top of its room that a file belongs to."""
    return path.relative_to(ROOT / room).parts[0].removesuffix(".py")


def later_imports(room: str, path: Path, source: str | None = None) -> set[str]:
    """What a file imports from its room and must not, because it comes later."""
    place = {unit: n for n, level in enumerate(ORDER[room]) for unit in level.split()}
    text = path.read_text(encoding="utf-8") if source is None else source
    names, inside = imports_of(text), room.replace("/", ".") + "."
    found = [name.removeprefix("softehl.") for name in names]
    units = {n.removeprefix(inside).split(".")[0] for n in found if n.startswith(inside)}
    limit = place[unit_of(room, path)]
    return {unit for unit in units & set(place) if place[unit] > limit}


def pending(room: str) -> list[pytest.MarkDecorator]:
    return [pytest.mark.xfail(strict=True, reason=PENDING[room])] if room in PENDING else []


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_what_they_may(room: str) -> None:
    assert (ROOT / room).is_dir()
    found = {path: breaches(room, path.read_text(encoding="utf-8")) for path in files_of(room)}
    assert {str(path): rooms for path, rooms in found.items() if rooms} == {}


@pytest.mark.parametrize(
    ("room", "source"),
    [
        ("cases", "import softehl.codegen.tools.build"),
        ("cases", "def f():\n    from codegen import graph"),
        ("runtime", "import importlib\nimportlib.import_module('softehl.codegen.pipeline')"),
        ("cases", "def f():\n    import_module(f'softehl.codegen.{name}')"),
        ("runtime", "from softehl.codegen.graph.graph import Graph"),
        ("runtime", "import softehl.cases.seal.solve.driver"),
        ("codegen", "from softehl.runtime.discretisation.quadrature import gauss"),
    ],
)
def test_a_breach_is_seen(room: str, source: str) -> None:
    assert breaches(room, source)


@pytest.mark.parametrize("room", [pytest.param(r, marks=pending(r)) for r in ORDER])
def test_folders_import_only_what_comes_before_them(room: str) -> None:
    found = {
        str(path.relative_to(ROOT)): later_imports(room, path)
        for path in files_of(room)
        if path.parent != ROOT / room or path.stem != "__init__"
    }
    late = {path: names for path, names in found.items() if names}
    assert late == {}


@pytest.mark.parametrize("room", ORDER)
def test_every_folder_has_its_place(room: str) -> None:
    """A new folder or file at the top of a room is to be put into its row."""
    units = {unit_of(room, path) for path in files_of(room)} - {"__init__"}
    assert units <= {unit for level in ORDER[room] for unit in level.split()}


@pytest.mark.parametrize(
    ("room", "path", "source"),
    [
        ("codegen", "graph/graph.py", "from softehl.codegen.emit.simd_kernel import lines"),
        ("codegen", "emit/simd.py", "from softehl.codegen import pipeline"),
        ("runtime", "mesh/mesh.py", "def f():\n    import softehl.runtime.discretisation.dofmap"),
        ("runtime", "solve/newton.py", "from softehl.runtime.discretisation import dofmap"),
        ("cases", "harness/run_record.py", "from softehl.cases.seal.states.state import FilmRow"),
        ("cases", "seal/solve/driver.py", "from softehl.cases import oring"),
        ("cases", "paper/states.py", "import softehl.cases.cli"),
        ("cases/seal", "gland/oils.py", "from softehl.cases.seal.section import layout"),
        ("cases/seal", "gland/sections/section_keys.py", "import softehl.cases.seal.states.state"),
        ("cases/seal", "states/verdict.py", "from softehl.cases.seal import solve"),
        ("cases/seal", "solve/driver.py", "def f():\n    from softehl.cases.seal import cycle"),
    ],
)
def test_an_import_out_of_order_is_seen(room: str, path: str, source: str) -> None:
    assert later_imports(room, ROOT / room / path, source)


def test_solvers_know_no_mesh() -> None:
    for path in SOLVERS:
        source = path.read_text(encoding="utf-8")
        assert not [
            name
            for name in imports_of(source)
            if name.removeprefix("softehl.").startswith(NOT_FOR_SOLVERS)
        ]


@pytest.mark.parametrize("room", ["runtime", "cases"])
def test_solving_names_no_symbolic_package(room: str) -> None:
    for path in files_of(room):
        names = {name.split(".")[0] for name in imports_of(path.read_text(encoding="utf-8"))}
        assert not names & set(HEAVY), path


def test_the_runtime_goes_not_through_the_front_door() -> None:
    """`softehl` imports the compiler for its loader of pages, which it hands to the runtime."""
    for path in files_of("runtime"):
        names = imports_of(path.read_text(encoding="utf-8"))
        assert not {"softehl", "softehl.load_kernel"} & set(names), path


def loaded_after(code: str) -> set[str]:
    """The top-level modules, and our rooms, that are loaded in a fresh interpreter after `code`."""
    ours = "'.'.join(n.split('.')[: 1 + n.startswith('softehl.')])"
    shown = f"{code}\nimport sys\nprint(*sorted({{{ours} for n in sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", shown], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(done.stdout.splitlines()[-1].split())


def test_solving_loads_no_sympy() -> None:
    loaded = loaded_after("import softehl\nfor name in softehl._PUBLIC: getattr(softehl, name)")
    assert "numpy" in loaded
    assert not loaded & {"sympy", "mpmath", "softehl.codegen", "matplotlib", "meshio"}


def test_help_loads_nothing_heavy() -> None:
    loaded = loaded_after(
        "import softehl\nassert softehl.main(['--help']) == softehl.main(['run', '--help']) == 0"
    )
    assert not loaded & {"numpy", "scipy", "pydantic", "rich", "sympy", "matplotlib", "meshio"}


def test_building_loads_no_sympy() -> None:
    assert "sympy" not in loaded_after("import softehl.codegen.tools.build")


def test_public_names() -> None:
    own = ["SoftehlError", "SymPyNeededError", "UnknownNameError", "load_kernel"]
    assert sorted([*softehl._PUBLIC, *softehl._MODELLING, *own]) == sorted(softehl.__all__)
    for name in softehl.__all__:
        assert getattr(softehl, name).__name__.rpartition(".")[2] in (name, "run", "Seal")
    assert softehl.ORing is softehl.Seal
    assert set(softehl.__all__) <= set(dir(softehl))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        softehl.nothing  # noqa: B018
