"""Matrix-free tangent, and its solution by Krylov methods with multigrid.

Conjugate gradients find z of T' A T, T of the constraints; the forces f of ties, whose equations
are B x = c, follow from B' f = r - A x (`TieForces`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.constraints import Constraints, tie_dofs
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.matrix_free_products import ElementProduct, require_product
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.linear.coarse_grid_solver import coarse_solver
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.krylov import conjugate_gradients, minimal_residuals
from softehl.runtime.solve.linear.linear_solver import Factors, SingularMatrix
from softehl.runtime.solve.linear.multigrid import Apply, MultigridCycle, MultigridLevel


@dataclass(frozen=True, eq=False)
class KrylovSettings:
    """Tolerance of the residual, relative to the right-hand side; iterations at most; counts of all
    solutions so far.
    """

    tolerance: float
    max_iterations: int
    counts: list[int] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class TieForces:
    """All ties of a problem, maybe none, and what moves on every level.

    matrix: (n, n) their part of the tangent. equations: B, (t, n), without prescribed unknowns, and
    normal: factors of B B'. forces: (t,) numbers of the forces. constraints: of the unknowns, and
    levels: of the unknowns of every level, and interpolations between them.
    """

    matrix: csr_array
    equations: csr_array
    normal: Factors | None
    forces: Integers
    constraints: Constraints
    levels: tuple[Constraints, ...]
    interpolations: tuple[csr_array, ...]

    @classmethod
    def of(cls, problem: Problem, multigrid: MultigridLevels) -> TieForces:
        """Of a problem, for the levels of multigrid."""
        constraints, n = problem.constraints, problem.assembler.size
        levels = tuple(constraints.restricted(numbers) for numbers in multigrid.unknowns)
        ties = tie_dofs(problem.assembler)
        a, b, forces = ties.T
        t, ones = len(ties), np.ones(len(ties))
        rows = np.tile(np.arange(t), 2)
        B = csr_array(coo_array((np.append(ones, -ones), (rows, np.append(a, b))), (t, n)))
        coupling = csr_array((ones, (forces, np.arange(t))), shape=(n, t)) @ B
        prescribed = constraints.prescribed.copy()
        prescribed[forces] = True
        equations = csr_array(B.multiply((~prescribed).astype(np.float64)[None]))
        normal = None
        if t:
            normal = direct_solver("auto").factorise(csc_array(equations @ equations.T))
        return cls(
            matrix=csr_array(coupling + coupling.T),
            equations=equations,
            normal=normal,
            forces=forces,
            constraints=constraints,
            levels=levels,
            interpolations=tuple(
                csr_array(without(step, upper.moving) @ lower.square)
                for step, (upper, lower) in zip(multigrid.steps, pairwise(levels), strict=True)
            ),
        )

    def shift(self, r: Array) -> Array:
        """The least x, (n,), of B x = r of the ties."""
        if self.normal is None:
            return np.zeros_like(r)
        return np.asarray(self.equations.T @ self.normal.solve(r[self.forces]))

    def put_forces(self, x: Array, left: Array) -> None:
        """Put into x the forces f of B' f = left, (n,), in the sense of least squares."""
        if self.normal is not None:
            x[self.forces] = self.normal.solve(self.equations @ left)


class TangentProduct(Protocol):
    """The tangent of a block: y += K x for vectors as `ElementNumbering.vector` makes them."""

    def __call__(self, x: Array, y: Array) -> None:
        """Add the product."""
        ...


class VectorSpace(Protocol):
    """The vectors of linear solutions, on the host or on a device.

    apply: T' K T v node by node, with ones for constrained unknowns.
    """

    def apply(self, v: Any) -> Any:
        """The operator."""
        ...

    def vector(self, a: Array) -> Any:
        """A vector of the host in this space."""
        ...

    def matrix(self, A: csr_array) -> Any:
        """A matrix of the host in this space."""
        ...

    def interpolation(self, level: int, P: csr_array) -> tuple[Any, Any]:
        """Interpolation to a level and its transpose, the same in many Newton steps."""
        ...

    def random(self, n: int, number: int = 0) -> Any:
        """A vector of random numbers, always the same."""
        ...

    def host(self, a: Any) -> Array:
        """A vector of this space on the host."""
        ...

    def converted(self, a: Any) -> Any:
        """A vector of another space, of the same place, in this one."""
        ...

    def coarse(self, A: csr_array, nullspace: Array, block: int) -> Apply:
        """A function that solves A x = b, at least about; see `coarse_solver`."""
        ...


class Backend(Protocol):
    """Place of residuals, products and linear solutions: the host, or a device."""

    def problem(self, problem: Problem, levels: MultigridLevels) -> Problem:
        """The problem with residuals that are evaluated there."""
        ...

    def product(
        self, block: ElementBlock, x: Array, parameters: Array, levels: MultigridLevels
    ) -> TangentProduct:
        """The tangent of a block at x, (n,)."""
        ...

    def coarse(
        self,
        block: ElementBlock,
        product: Any,
        x: Array,
        levels: MultigridLevels,
        free: Flags,
    ) -> tuple[csr_array, Array]:
        """The matrix of a block at the lower order, and its part of the diagonal of K, (n,)."""
        ...

    def spaces(self, operator: MatrixFreeOperator) -> tuple[VectorSpace, VectorSpace]:
        """The vectors of linear solutions of an operator, and of their preconditioner."""
        ...


class Processor:
    """The processor of this process."""

    def problem(self, problem: Problem, levels: MultigridLevels) -> Problem:
        """See `Backend`."""
        return problem

    def product(
        self, block: ElementBlock, x: Array, parameters: Array, levels: MultigridLevels
    ) -> TangentProduct:
        """See `Backend`."""
        return ElementProduct.of(block, x, parameters, levels.numberings[block.name])

    def coarse(
        self,
        block: ElementBlock,
        product: Any,
        x: Array,
        levels: MultigridLevels,
        free: Flags,
    ) -> tuple[csr_array, Array]:
        """See `Backend`."""
        return coarse_matrix(block, product, x, levels, free)

    def spaces(self, operator: MatrixFreeOperator) -> tuple[VectorSpace, VectorSpace]:
        """See `Backend`."""
        space = HostSpace(operator)
        return space, space


@dataclass(frozen=True, eq=False)
class HostSpace:
    """Vectors of NumPy."""

    operator: MatrixFreeOperator

    def apply(self, v: Array) -> Array:
        """See `VectorSpace`."""
        return self.operator.apply(v)

    def vector(self, a: Array) -> Array:
        """See `VectorSpace`."""
        return a

    def matrix(self, A: csr_array) -> csr_array:
        """See `VectorSpace`."""
        return A

    def interpolation(self, level: int, P: csr_array) -> tuple[csr_array, csr_array]:
        """See `VectorSpace`."""
        return P, csr_array(P.T)

    def random(self, n: int, number: int = 0) -> Array:
        """See `VectorSpace`."""
        return random_vector(n, number)

    def host(self, a: Array) -> Array:
        """See `VectorSpace`."""
        return a

    def converted(self, a: Array) -> Array:
        """See `VectorSpace`."""
        return a

    def coarse(self, A: csr_array, nullspace: Array, block: int) -> Apply:
        """See `VectorSpace`."""
        return coarse_solver(A, nullspace, block)


@dataclass(frozen=True, eq=False)
class MatrixFreeOperator:
    """The tangent at a state: products of pages, a matrix of loads and springs, and multigrid.

    rest: matrix of loads and springs, node by node as the first level has it. diagonals: of K,
    (n,). ties: of its unknowns. lower: K at the first lower level, in what moves there. held:
    places of what does not move by itself, and work: two vectors for products, node by node.
    """

    problem: Problem
    levels: MultigridLevels
    iteration: KrylovSettings
    products: tuple[TangentProduct, ...]
    loads_matrix: csr_array
    diagonals: Array
    ties: TieForces
    lower: csr_array
    constrained: Integers
    work: tuple[Array, Array]
    backend: Backend

    @classmethod
    def of(
        cls,
        problem: Problem,
        levels: MultigridLevels,
        iteration: KrylovSettings,
        ties: TieForces,
        x: Array,
        backend: Backend | None = None,
    ) -> MatrixFreeOperator:
        """At x, (n,); on the host if no backend is given."""
        backend = backend or Processor()
        products, diagonal, loads_matrix = [], np.zeros(len(x)), csr_array((len(x), len(x)))
        count = levels.steps[0].shape[1]
        lower = csr_array((count, count))
        for block in problem.assembler.blocks:
            parameters = problem.parameters.get(block.name)
            if parameters is None or not len(block.dofs) or isinstance(block.kernel, Tie):
                continue
            if block.name in levels.numberings:
                product = backend.product(block, x, parameters, levels)
                products.append(product)
                free = ties.constraints.free
                coarse, coarse_diagonal = backend.coarse(block, product, x, levels, free)
                lower, diagonal = lower + coarse, diagonal + coarse_diagonal
            else:
                tangents = block.tangent(x, parameters)[1]
                loads_matrix = loads_matrix + assembled(block.dofs, tangents, len(x))
        diagonal += loads_matrix.diagonal()
        order = levels.unknowns[0]
        if loads_matrix.nnz:
            loads_matrix = csr_array(loads_matrix)[order][:, order]
            P = without(levels.steps[0], ties.constraints.free[order])
            lower = lower + P.T @ loads_matrix @ P
        T = ties.levels[1].square
        numbering = next(iter(levels.numberings.values()))
        constrained = np.flatnonzero(~ties.levels[0].moving)
        work = numbering.vector(), numbering.vector()
        return cls(
            problem=problem,
            levels=levels,
            iteration=iteration,
            products=tuple(products),
            loads_matrix=csr_array(loads_matrix),
            diagonals=diagonal,
            ties=ties,
            lower=csr_array(T.T @ lower @ T),
            constrained=constrained,
            work=work,
            backend=backend,
        )

    def times(self, v: Array) -> Array:
        """K v, prescribed unknowns included."""
        return np.asarray(self._untied(v) + self.ties.matrix @ v)

    def _untied(self, v: Array) -> Array:
        """K v without ties."""
        order, y = self.levels.unknowns[0], np.empty_like(v)
        source, target = self.work
        source[: len(v)] = v[order]
        y[order] = self._product(source, target)
        return y

    def _product(self, source: Array, target: Array) -> Array:
        """K v without ties, node by node, of the first numbers of a vector for products; a part
        of the other one.
        """
        n = self.levels.unknowns[0].size
        target.fill(0.0)
        for product in self.products:
            product(source, target)
        if self.loads_matrix.nnz:
            target[:n] += self.loads_matrix @ source[:n]
        return target[:n]

    def apply(self, v: Array) -> Array:
        """T' K T v node by node, with ones for constrained unknowns."""
        source, target = self.work
        x, constraints = source[: len(v)], self.ties.levels[0]
        x[:] = v
        x[self.constrained] = 0.0
        constraints.copy_to_slaves(x)
        y = self._product(source, target).copy()
        constraints.collect(y)
        y[self.constrained] = v[self.constrained]
        return y

    def __matmul__(self, v: Array) -> Array:
        """K v as `solve` has it: prescribed unknowns have equations of their own."""
        fixed = self.problem.fixed
        moving = v.copy()
        moving[fixed] = 0.0
        product = self.times(moving)
        product[fixed] = v[fixed]
        return product

    def diagonal(self) -> Array:
        """Of K."""
        return self.diagonals

    def __abs__(self) -> _Bound:
        return _Bound(self)

    def unconstrained_unknown(self) -> None:
        """See `JudgesSingularity`: iterations that converged show that the matrix is regular."""

    def solve(self, r: Array) -> Array:
        """x of K x = r.  Raises SingularMatrix if the iteration does not converge."""
        order, ties, constraints = self.levels.unknowns[0], self.ties, self.ties.levels[0]
        fixed, tied = self.problem.fixed, len(self.ties.forces) > 0
        x = ties.shift(r)
        b = (r - self._untied(x) if tied else r)[order]
        constraints.collect(b)
        b[self.constrained] = 0.0
        z = self._iterated(b)
        constraints.copy_to_slaves(z)
        x[order] += z
        if tied:
            ties.put_forces(x, r - self._untied(x))
        x[fixed] = r[fixed]
        return x

    def _iterated(self, b: Array) -> Array:
        """z of T' K T z = b, node by node; zero for constrained unknowns."""
        settings, (space, inner) = self.iteration, self.backend.spaces(self)
        cycle = self._multigrid(inner)
        mixed = inner is not space
        if mixed:
            cycle = _converted(space, inner, cycle)
        if self._is_symmetric(space):
            result = conjugate_gradients(
                space.apply,
                cycle,
                space.vector(b),
                tolerance=settings.tolerance,
                max_iterations=settings.max_iterations,
            )
        else:  # by SciPy, with vectors of the host
            apply, precondition = (_on_host(space, action) for action in (space.apply, cycle))
            result = minimal_residuals(
                apply,
                precondition,
                b,
                tolerance=settings.tolerance,
                max_iterations=settings.max_iterations,
            )
        settings.counts.append(result.iterations)
        # up to a negative curvature it is a direction of descent, which Newton's method may take
        x = space.host(result.x)
        if not (result.converged or result.negative) or not np.isfinite(x).all():
            raise SingularMatrix(
                f"matrix-free: no linear solution after {result.iterations} iterations: "
                f"{'leave precision out, ' if mixed else ''}leave linear out, or take more steps"
            )
        return x

    def is_symmetric(self) -> bool:
        """True if two random vectors say so."""
        return self._is_symmetric(self.backend.spaces(self)[0])

    def _is_symmetric(self, space: VectorSpace) -> bool:
        u, v = (space.random(len(self.diagonals), k) for k in range(2))
        Ku, Kv = space.apply(u), space.apply(v)
        size = float(np.linalg.norm(u)) * float(np.linalg.norm(Kv))
        return abs(float(u @ Kv) - float(v @ Ku)) <= 1e-10 * size

    def _multigrid(self, space: VectorSpace) -> Apply:
        levels, level_constraints = self.levels, self.ties.levels
        diagonal = self.diagonals[levels.unknowns[0]]
        if not np.isfinite(diagonal).all():
            raise SingularMatrix("the tangent has entries that are not finite")
        level_constraints[0].collect(diagonal)
        diagonal[self.constrained] = 1.0
        multigrid_levels, matrix = list[MultigridLevel](), self.lower
        for k, (P, upper) in enumerate(
            zip(self.ties.interpolations, level_constraints[:-1], strict=True)
        ):
            transfer = space.interpolation(k, P)
            if not multigrid_levels:
                multigrid_levels.append(level_in(space, space.apply, diagonal, transfer))
                continue
            A = _with_ones(matrix, upper.moving)
            apply = space.matrix(A).__matmul__
            multigrid_levels.append(level_in(space, apply, A.diagonal(), transfer))
            matrix = csr_array(P.T @ matrix @ P)
        moving = level_constraints[-1].moving
        masked_nullspace = np.where(moving[:, None], levels.nullspace, 0.0)
        lowest = space.coarse(_with_ones(matrix, moving), masked_nullspace, levels.components)
        return MultigridCycle(multigrid_levels, lowest)


def _converted(space: VectorSpace, inner: VectorSpace, action: Apply) -> Apply:
    """A linear function of vectors of an inner space for those of a space, without overflow."""

    def apply(v: Any) -> Any:
        size = float(np.linalg.norm(v)) or 1.0
        return size * space.converted(action(inner.converted(v / size)))

    return apply


def _on_host(space: VectorSpace, action: Apply) -> Apply:
    """A function of vectors of a space for those of the host."""
    return lambda v: space.host(action(space.vector(v)))


def level_in(
    space: VectorSpace, apply: Apply, diagonal: Array, transfer: tuple[Any, Any]
) -> MultigridLevel:
    """A level of multigrid in a space; transfer: interpolation and its transpose there."""
    start = space.random(len(diagonal))
    return MultigridLevel.of(apply, space.vector(diagonal), *transfer, start)


def random_vector(n: int, number: int = 0) -> Array:
    """Random numbers between -1 and 1, (n,), always the same of a number."""
    return np.random.default_rng(number).uniform(-1.0, 1.0, n)


@dataclass(frozen=True, eq=False)
class _Bound:
    """A bound of |K|: |K_ij| <= sqrt(K_ii K_jj) inside every element."""

    tangent: MatrixFreeOperator

    def __matmul__(self, x: Array) -> Array:
        problem = self.tangent.problem
        root = np.sqrt(np.abs(self.tangent.diagonals))
        root[problem.fixed] = 0.0
        around = problem.assembler.around(root * x, problem.parameters)
        return np.asarray(root * around + abs(self.tangent.ties.matrix) @ x)


def coarse_matrix(
    block: ElementBlock, product: ElementProduct, x: Array, levels: MultigridLevels, free: Flags
) -> tuple[csr_array, Array]:
    """The matrix of a block at the next lower order, and the diagonal of K, (n,).

    Both follow from the moduli at the points. Where a constrained unknown stands between free ones
    of the lower order, they see only a part of K: there tangents of elements are projected.
    """
    name, n = block.name, len(free)
    numbering, dofs = levels.numberings[name], levels.lower[name]
    diagonals, tangents = product.coarse(require_product(block))
    assert tangents.shape[1] == dofs.shape[1], "the orders of the next level differ"
    repeated = numbering.repeated
    diagonals[repeated] = 0.0
    tangents[repeated] = 0.0
    rows = block.dofs[numbering.order].ravel()
    diagonal = _summed(rows, diagonals, n)
    moving = free[levels.unknowns[1]][dofs]
    split = np.flatnonzero(_are_split(block, levels.transfers[name].matrix(), free, moving))
    mask = moving[numbering.order].astype(np.float64)
    mask[np.isin(numbering.order, split)] = 0.0
    constrained = np.flatnonzero((mask == 0.0).any(axis=1))
    some = mask[constrained]
    tangents[constrained] *= some[:, :, None] * some[:, None, :]
    pattern = levels.pattern(name)
    matrix = csr_array(pattern.matrix(_summed(pattern.scatter[0], tangents, pattern.nnz)))
    if len(split):
        projected = projected_tangents(block, x, product.parameters, levels, free, split)
        matrix = matrix + assembled(dofs[split], projected, pattern.size)
    return matrix, diagonal


def _summed(positions: Integers, values: Array, size: int) -> Array:
    """Sums (size,) of values at places."""
    sums = np.bincount(positions, weights=values.ravel(), minlength=size)
    return np.asarray(sums, dtype=np.float64)


def _are_split(block: ElementBlock, P: Array, free: Flags, moving: Flags) -> Flags:
    """Elements (n,) of which a constrained unknown depends on a free one of the lower order.

    moving: (n, k) free unknowns of the lower order.
    """
    constrained = ~free[block.dofs]
    some = np.flatnonzero(constrained.any(axis=1))
    depends = constrained[some].astype(np.float64) @ (np.abs(P) > 1e-14) > 0
    split = np.zeros(len(constrained), dtype=bool)
    split[some] = (depends & moving[some]).any(axis=1)
    return split


def projected_tangents(
    block: ElementBlock,
    x: Array,
    parameters: Array,
    levels: MultigridLevels,
    free: Flags,
    elements: Integers,
) -> Array:
    """Tangents (m, k, k) of elements at the lower order, of their free unknowns alone."""
    P, dofs = levels.transfers[block.name].matrix(), levels.lower[block.name][elements]
    projected, at = np.empty((len(dofs), P.shape[1], P.shape[1])), 0
    for piece, _ in block.part(elements).pieces(np.empty(0, dtype=np.int64)):
        masked = P[None] * free[piece.dofs].astype(np.float64)[:, :, None]
        tangents = piece.tangent(x, parameters)[1]
        projected[at : at + len(masked)] = np.swapaxes(masked, 1, 2) @ (tangents @ masked)
        at += len(masked)
    mask = free[levels.unknowns[1]][dofs].astype(np.float64)
    return projected * mask[:, :, None] * mask[:, None, :]


def assembled(dofs: Integers, tangents: Array, size: int) -> csr_array:
    """Assembled from the matrices (n, k, k) of elements."""
    k = dofs.shape[1]
    rows, columns = np.repeat(dofs, k, axis=1).ravel(), np.tile(dofs, k).ravel()
    return csr_array(coo_array((tangents.ravel(), (rows, columns)), (size, size)))


def without(step: csr_array, moving: Flags) -> csr_array:
    """Interpolation with the rows of constrained unknowns set to zero."""
    return csr_array(step.multiply(moving.astype(np.float64)[:, None]))


def _with_ones(A: csr_array, free: Flags) -> csr_array:
    """With a typical number on the diagonal of prescribed unknowns."""
    typical = float(np.abs(A.diagonal()).mean()) or 1.0
    entries = np.where(free, 0.0, typical)
    n = len(free)
    return csr_array(A + csr_array((entries, (np.arange(n), np.arange(n))), (n, n)))
