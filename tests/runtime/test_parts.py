"""How a study is cut into parts: by any partition, the sum of the parts is the whole."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import softehl
from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.equations.system import System
from softehl.runtime.mpi import MissingPetsc
from softehl.runtime.parallel.engine import engine_of
from softehl.runtime.parallel.partitioning import (
    CellGraph,
    LocalSystem,
    Partition,
    part_of,
    partition,
)
from tests.runtime import solid_page as pages

PROCESSES = 3


def sheared() -> System:
    """A block on a floor, its sides tied, with loads, springs and a pressure."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(6, 4)))
    study.add("body", pages.solid(), mu=0.4, lame=1.5, thickness=lambda x: 1.0 + x[:, 0])
    study.add("floor", pages.floor(), on="bottom", k=1e3)
    study.tie("left", "right", "u_x", "u_y")
    study.spring("bottom", u_x=2.0)
    study.load("top", u_x=lambda x, t: 0.1 * t * x[:, 0])
    study.load((0.0, 1.0), u_y=-0.2)
    study.pressure("top", 0.05)
    study.fix((0.0, 0.0), u_x=0.0)
    return study.system()


def cut(system: System, rng: np.random.Generator) -> Partition:
    """Cells dealt to the processes as by dice, the worst partition there is."""
    cells = CellGraph.of(system)
    return partition(system, cells, rng.integers(0, PROCESSES, cells.count), PROCESSES)


def parts(system: System, found: Partition) -> list[LocalSystem]:
    return [part_of(system, found, process) for process in range(PROCESSES)]


def residual(system: System, x: Array) -> Array:
    problem = system.problem(system.quasi_static_step(0.7, np.zeros(system.size), {}))
    return problem.assembler.residual(x, problem.parameters)


def test_parts_add_up_to_the_whole(rng: np.random.Generator) -> None:
    system = sheared()
    x = 0.01 * rng.normal(size=system.size)
    total = np.zeros(system.size)
    for part in parts(system, cut(system, rng)):
        total[part.unknowns] += residual(part.system, x[part.unknowns])
    np.testing.assert_allclose(total, residual(system, x), atol=1e-13)


def test_a_part_that_is_left_out_is_seen(rng: np.random.Generator) -> None:
    system = sheared()
    x = 0.01 * rng.normal(size=system.size)
    total = np.zeros(system.size)
    for part in parts(system, cut(system, rng))[:-1]:
        total[part.unknowns] += residual(part.system, x[part.unknowns])
    assert np.abs(total - residual(system, x)).max() > 1e-3


def test_every_unknown_has_one_owner_and_one_number(rng: np.random.Generator) -> None:
    system = sheared()
    found = cut(system, rng)
    assert sorted(found.numbers.tolist()) == list(range(system.size))
    owned = np.concatenate([part.unknowns[part.owned] for part in parts(system, found)])
    assert sorted(owned.tolist()) == list(range(system.size))
    for process in range(PROCESSES):
        numbers = found.numbers[found.owners == process]
        assert numbers.min() >= found.starts[process]
        assert numbers.max() < found.starts[process + 1]


def test_displacements_stand_node_by_node_where_there_is_nothing_else() -> None:
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(3, 3)))
    study.add("body", pages.solid(), mu=0.4, lame=1.5, thickness=1.0)
    system = study.system()
    found = partition(system, CellGraph.of(system), np.zeros(9, dtype=np.int64), 1)
    assert found.interleaved == 2
    nodal = system.numbering.nodal
    assert (found.numbers[nodal["u_y"]] == found.numbers[nodal["u_x"]] + 1).all()
    assert cut(sheared(), np.random.default_rng(0)).interleaved == 1


def test_prescribed_values_are_those_of_the_whole(rng: np.random.Generator) -> None:
    """Also where a function asks for all places of a side."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(6, 4)))
    study.add("body", pages.solid(), mu=0.4, lame=1.5, thickness=1.0)
    study.fix("left", u_x=0.0, u_y=lambda x, t: x[:, 1] - x[:, 1].mean())
    system = study.system()
    whole = system.problem(system.quasi_static_step(1.0, np.zeros(system.size), {}))
    known = dict(zip(whole.fixed.tolist(), whole.values.tolist(), strict=True))
    there: dict[int, float] = {}
    for part in parts(system, cut(system, rng)):
        problem = part.system.problem(
            part.system.quasi_static_step(1.0, np.zeros(part.system.size), {})
        )
        there |= zip(part.unknowns[problem.fixed].tolist(), problem.values.tolist(), strict=True)
    assert there == known


def test_neighbours_have_a_face_in_common() -> None:
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(3, 3)))
    study.add("body", pages.solid(), mu=0.4, lame=1.5, thickness=1.0)
    graph = CellGraph.of(study.system()).neighbours(slice(4, 5), 2)
    assert sorted(graph.indices.tolist()) == [1, 3, 4, 5, 7]


def test_an_engine_that_is_not_there() -> None:
    with pytest.raises(StudyError, match='"serial" and "petsc"'):
        engine_of("pets")


@pytest.mark.skipif(importlib.util.find_spec("petsc4py") is not None, reason="PETSc is there")
def test_without_petsc_the_message_says_what_to_install() -> None:
    with pytest.raises(MissingPetsc, match=r"pip install 'softehl\[mpi\]'"):
        engine_of("petsc")


@pytest.mark.skipif(importlib.util.find_spec("petsc4py") is not None, reason="PETSc is there")
def test_a_seal_without_petsc_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for way in (["--engine", "petsc"], ["--set", "linear=petsc"]):
        assert softehl.main(["run", "oring", *way, "--out", str(tmp_path / "no")]) == 2
        told = capsys.readouterr().err
        assert told.count("\n") == 1
        assert "pip install 'softehl[mpi]'" in told
    assert not (tmp_path / "no").exists()
