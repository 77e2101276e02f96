"""The engine `matrix-free`: conjugate gradients with products, and multigrid in the order.

The tangent of pages is never a matrix, nor are those of elements. At every Newton step its diagonal
and the matrix of the next lower order are made of the moduli at the points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.device.device_module import DEVICES
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_operator import (
    Backend,
    KrylovSettings,
    MatrixFreeOperator,
    Processor,
    TieForces,
)
from softehl.runtime.discretisation.matrix_free_products import (
    NoProductError,
    require_product,
    threads,
)
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.solve.newton import EvolvingProblem, Newton
from softehl.runtime.suggestions import join_names

PRECISIONS = ("double", "mixed")
_WHO = 'linear = "matrix-free"'
NO_INERTIA = f"{_WHO}: inertia has no such products; leave linear out"

TOLERANCE = 1e-4
"""Of linear solutions.  Iterations of a whole load step for 1e-6, 1e-5, 1e-4, 1e-3, all of which
end at Newton's tolerance: K/mu = 1000 396, 321, 253, 264; nu = 0.3 26, 22, 18, 15.
"""


@dataclass(eq=False)
class MatrixFree:
    """Engine that assembles no matrix: conjugate gradients with p-multigrid.

    Parameters
    ----------
    tolerance : float
        Tolerance of the linear solutions, relative to the residual.
    most : int
        Largest number of iterations of one solution.
    threads : int, optional
        Threads of the products; $OMP_NUM_THREADS, or all processors, if left out.
    iterations : list of int
        Iterations of every solution so far.
    device : str, optional
        "cuda": products and linear solutions on a GPU, by CuPy. "emulated": the same kernels,
        compiled for the processor, for tests. Left out: the processor, by kernels in C.
    precision : str
        "mixed", with a device: multigrid in single precision, everything else in double. "double":
        all of it in double.

    Raises
    ------
    StudyError
        A setting is not allowed.
    """

    tolerance: float = TOLERANCE
    most: int = 1000
    threads: int | None = None
    iterations: list[int] = field(default_factory=list)
    device: str | None = None
    precision: str = "double"

    def __post_init__(self) -> None:
        """Raises StudyError for settings that no solution can meet."""
        if self.precision not in PRECISIONS:
            raise StudyError(
                f"precision = {self.precision!r}: allowed are {join_names(map(repr, PRECISIONS))}"
            )
        if self.precision == "mixed" and self.device is None:
            raise StudyError(
                'precision = "mixed": the kernels of the processor are in double precision; give a '
                "device, or leave precision out"
            )
        if self.device not in (None, *DEVICES):
            raise StudyError(
                f"device = {self.device!r}: allowed are {join_names(map(repr, DEVICES))}, or leave "
                "it out"
            )
        if not (0 < self.tolerance < 1 and self.most >= 1 and (self.threads or 1) >= 1):
            raise StudyError(
                f"MatrixFree(tolerance={self.tolerance!r}, most={self.most!r}, threads="
                f"{self.threads!r}): allowed are 0 < tolerance < 1, most >= 1, threads >= 1 or None"
            )

    def distribute(self, system: System) -> System:
        """See `Engine`.  Raises StudyError for what it cannot solve."""
        system.mesh.require_whole(_WHO)
        pages, order = require_products(system)
        levels = levels_of(system, pages, order, self.threads or threads())
        iteration = KrylovSettings(self.tolerance, self.most, self.iterations)
        backend = Processor() if self.device is None else self._on_device(system)
        return replace(system, comm=_MatrixFreeCommunicator(levels, iteration, backend))

    def _on_device(self, system: System) -> Backend:
        """The device, with the kernels of all pages.  Raises StudyError."""
        from softehl.runtime.device.device_operator import Device

        assert self.device is not None
        device = Device(self.device, mixed=self.precision == "mixed")
        for name in system.blocks:
            device.require(system.assembler.block(name))
        return device

    def newton(self, system: System, requested: Newton | None) -> Newton:
        """See `Engine`."""
        return replace(requested or Newton(), linear=MatrixFreeSolver())


@dataclass(frozen=True)
class MatrixFreeSolver:
    """The linear solver of such problems."""

    name: str = "matrix-free"

    def factorise(self, K: Any) -> MatrixFreeOperator:
        """The tangent itself, which can solve."""
        assert isinstance(K, MatrixFreeOperator)
        return K


def require_products(system: System) -> tuple[list[ElementBlock], int]:
    """Blocks of pages with matrix-free products, and their order.  Raises StudyError for others."""
    try:
        pages = [system.assembler.block(name) for name in system.blocks]
        kernels = [require_product(block) for block in pages]
    except NoProductError as error:
        raise StudyError(f"{_WHO}: {error}") from None
    cells = {kernel.cell: CELLS[kernel.cell].order for kernel in kernels}
    if len(set(cells.values())) > 1:
        raise StudyError(f"{_WHO}: cells {', '.join(cells)} have several orders; it takes one")
    fields = {tuple(dict.fromkeys(name for name, _ in kernel.places)) for kernel in kernels}
    if len(fields) > 1:
        raise StudyError(f"{_WHO}: pages have different fields; all must have the same")
    return pages, next(iter(cells.values()))


def levels_of(
    system: System, pages: list[ElementBlock], order: int, threads: int
) -> MultigridLevels:
    """Levels of multigrid for blocks of cells of an order."""
    points, dofmap = system.mesh.points, system.numbering.nodal
    return MultigridLevels.of(points, dofmap, pages, order=order, size=system.size, threads=threads)


class _MatrixFreeCommunicator(Communicator):
    """Communicator of one process, without matrices."""

    def __init__(
        self, levels: MultigridLevels, iteration: KrylovSettings, backend: Backend
    ) -> None:
        self.levels, self.iteration, self.backend = levels, iteration, backend

    def local_problem(self, distributed: MatrixFreeProblem) -> Problem:
        """See `Communicator`."""
        return distributed.problem

    def with_other_elements(self) -> Communicator:
        """See `Communicator`.  Raises StudyError."""
        raise StudyError(NO_INERTIA)

    def distribute(self, problem: Problem) -> MatrixFreeProblem:
        """See `Communicator`."""
        there = self.backend.problem(problem, self.levels)
        ties = TieForces.of(there, self.levels)
        return MatrixFreeProblem(there, self.levels, self.iteration, self.backend, ties)


@dataclass(frozen=True, eq=False)
class MatrixFreeProblem:
    """A problem with a matrix-free tangent; ties: of all its states."""

    problem: Problem
    levels: MultigridLevels
    iteration: KrylovSettings
    backend: Backend
    ties: TieForces

    @property
    def equations(self) -> Problem:
        """With a matrix."""
        return self.problem

    @property
    def assembler(self) -> Assembler:
        """See `Problem`."""
        return self.problem.assembler

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See `Problem`."""
        return self.problem.parameters

    def fields(self, name: str, x: Array) -> dict[str, Array]:
        """See `Problem`."""
        return self.problem.fields(name, x)

    def at(self, x: Array) -> MatrixFreeProblem:
        """See `Problem`."""
        there = self.problem.at(x)
        return self if there is self.problem else replace(self, problem=there)

    def after(self, previous: Array, x: Array) -> MatrixFreeProblem:
        """See `EvolvingProblem`."""
        if not isinstance(self.problem, EvolvingProblem):
            return self
        return replace(self, problem=self.problem.after(previous, x))

    def residual(self, x: Array) -> Array:
        """See `Problem`."""
        return self.problem.residual(x)

    def linearise(self, x: Array) -> tuple[Array, MatrixFreeOperator]:
        """See `Problem`."""
        problem = self.problem.at(x)
        r = problem.assembler.residual(x, problem.parameters)
        tangent = MatrixFreeOperator.of(
            problem, self.levels, self.iteration, self.ties, x, self.backend
        )
        constraints = problem.constraints
        return constraints.residual(r, constraints.deviation(x), tangent.times), tangent

    def norm(self, r: Array) -> float:
        """Never asked: the problem measures its residuals itself."""
        raise NotImplementedError

    def step_limit(self, x: Array, dx: Array) -> float:
        """See `Problem`."""
        return self.problem.step_limit(x, dx)

    def measure(self, x: Array, K: Any, *, rounded: bool = False) -> float:
        """See `Problem`, where |K| is taken for its bound by the diagonal."""
        return self.problem.measure(x, K, rounded=rounded)

    def name_of(self, number: int) -> str:
        """See `Problem`."""
        return self.problem.name_of(number)

    def where_not_finite(self, x: Array) -> str:
        """See `Problem`."""
        return self.problem.where_not_finite(x)
