"""A solid of ours assembled by DOLFINx through its custom kernels, against our own assembly.

Runs where DOLFINx is installed (`pip install 'softehl[mpi]'`, Python >= 3.12).  Unknowns of the
two sides are matched by the position of their node, not by any assumption on its number.
"""

from __future__ import annotations

import contextlib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.codegen.abi import Target
from softehl.codegen.models import ALL
from softehl.codegen.pipeline import compile_model
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.kernels.kernel import load_kernel
from tests.codegen.cell_kernels import TENSOR, CellKernels, Plane, cell_kernels, distorted
from tests.codegen.element_states import MATERIALS

with warnings.catch_warnings(), contextlib.suppress(ImportError):
    warnings.simplefilter("ignore")
    import dolfinx_solver  # noqa: F401 - loads MPI first
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    dolfinx: Any = pytest.importorskip("dolfinx", minversion="0.10")
    basix_ufl: Any = pytest.importorskip("basix.ufl")
    pytest.importorskip("dolfinx.fem")
    MPI: Any = pytest.importorskip("mpi4py.MPI")

LIMIT = 1e-12
MATERIAL = np.array(MATERIALS[0])
FAMILIES = ("solid_q4", "solid_fbar")


class Cells:
    """The mesh, the space of displacements and the state as DOLFINx holds them."""

    def __init__(self, plane: Plane) -> None:
        element = basix_ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
        tensor = np.empty_like(plane.cells)
        tensor[:, list(TENSOR)] = plane.cells
        self.mesh = dolfinx.mesh.create_mesh(MPI.COMM_SELF, tensor, element, plane.points)
        self.space = dolfinx.fem.functionspace(self.mesh, ("Lagrange", 1, (2,)))
        found = self.space.tabulate_dof_coordinates()[:, :2]
        distance = np.linalg.norm(found[:, None] - plane.points[None], axis=2)
        assert np.sort(distance, axis=1)[:, 0].max() < 1e-12
        self.node = distance.argmin(axis=1)
        """Our node of each of DOLFINx's."""
        self.u = dolfinx.fem.Function(self.space, dtype=np.float64)
        self.u.x.array[:] = plane.motion[self.node].ravel()
        self.c = dolfinx.fem.Constant(self.mesh, MATERIAL)

    @property
    def dofs(self) -> Any:
        """Our unknown of each of DOLFINx's."""
        return (2 * self.node[:, None] + [0, 1]).ravel()

    def form(self, kernels: CellKernels, task: str, rank: int) -> Any:
        """A form whose only integral is the generated kernel over all cells."""
        fem = dolfinx.fem
        count = self.mesh.topology.index_map(2).size_local
        active = np.array([0], dtype=np.int8)
        integral = (0, kernels.address(task), np.arange(count, dtype=np.int32), active)
        make = fem.forms.form_cpp_class(np.float64)
        spaces, on = [self.space._cpp_object] * rank, self.mesh._cpp_object
        coefficients, constants = [self.u._cpp_object], [self.c._cpp_object]
        integrals = {fem.IntegralType.cell: [integral]}
        return fem.Form(make(spaces, integrals, coefficients, constants, False, [], on))

    def vector(self, kernels: CellKernels) -> Array:
        """Residual that DOLFINx assembles, by our numbers."""
        b = dolfinx.fem.assemble_vector(self.form(kernels, "residual", 1))
        out = np.empty(len(self.dofs))
        out[self.dofs] = b.array
        return out

    def matrix(self, kernels: CellKernels) -> Array:
        """Tangent that DOLFINx assembles, by our numbers."""
        A = dolfinx.fem.assemble_matrix(self.form(kernels, "tangent", 2)).to_dense()
        out = np.empty(A.shape)
        out[np.ix_(self.dofs, self.dofs)] = A
        return out

    def energy(self, kernels: CellKernels) -> float:
        return float(dolfinx.fem.assemble_scalar(self.form(kernels, "energy", 0)))


def ours(family: str, plane: Plane) -> tuple[Array, Array]:
    """Residual and tangent of the project's own assembly."""
    X = plane.points[plane.cells].reshape(-1, 8)
    block = ElementBlock("solid", load_kernel(family), X, plane.dofs)
    assembler = Assembler.build(plane.points.size, [block])
    R, K = assembler.linearise(plane.motion.ravel(), {"solid": MATERIAL})
    return R, K.toarray()


def close(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= LIMIT * np.abs(b).max())


@pytest.mark.parametrize("family", FAMILIES)
def test_dolfinx_assembles_what_we_assemble(
    family: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    plane = distorted(rng)
    cells, kernels = Cells(plane), cell_kernels(ALL[family](), tmp_path)
    R, K = ours(family, plane)
    assert close(cells.vector(kernels), R)
    assert close(cells.matrix(kernels), K)
    assert K.any(axis=1).all()


def test_dolfinx_sums_the_energy(tmp_path: Path, rng: np.random.Generator) -> None:
    plane = distorted(rng)
    cells, kernels = Cells(plane), cell_kernels(ALL["solid_q4"](), tmp_path)
    X, u = plane.points[plane.cells].reshape(-1, 8), plane.motion.ravel()[plane.dofs]
    expected = load_kernel("solid_q4").energy(X, u, parameters=MATERIAL).sum()
    assert cells.energy(kernels) == pytest.approx(expected, rel=LIMIT)


def test_the_comparison_sees_our_order_of_vertices(
    tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel that takes DOLFINx's vertices for ours is found out."""
    monkeypatch.setattr("softehl.codegen.abi.VERTEX_ORDER", {(4, 2): (0, 1, 2, 3)})
    plane = distorted(rng)
    assert "1 at 0, 2 at 1, 3 at 2, 4 at 3" in compile_model(ALL["solid_q4"](), Target.UFCX).text
    cells, kernels = Cells(plane), cell_kernels(ALL["solid_q4"](), tmp_path)
    R, K = ours("solid_q4", plane)
    assert not close(cells.vector(kernels), R)
    assert not close(cells.matrix(kernels), K)
