"""Eigenvalues of large sparse matrices about a state: vibration, buckling, signs of pivots.

ARPACK (through SciPy) finds them by shift and inverse; SuperLU has the factors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse import csc_array, diags_array, eye_array
from scipy.sparse import linalg as sparse_linalg

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear.elimination_ordering import without_zeros
from softehl.runtime.solve.linear.linear_solver import SingularMatrix

_SMALL_SHIFT = 1e-7
"""Of the largest ratio of the diagonals: the first shift below zero, above rounding."""
_SHIFTS = 6
_BESIDE = 1e-12  # of the largest entry: a shift that rounding may have made
_DENSE = 20  # unknowns: fewer need no sparse eigenvalues, or cannot have them
_WEAK = 1e-8
"""Of the pivot that a multiplier without an energy of its own has when the others are eliminated:
it gets as much on the diagonal. Below the accuracy of pivots on the diagonal, above rounding; from
1e-6 to 1e-10 frequencies of incompressible cells are the same to 1e-11."""
_NOTHING = 100 * float(np.finfo(np.float64).eps)
"""Of the terms of x' K x: a smaller eigenvalue is zero. Those of rigid motions are below 1e-16, the
lowest elastic one of a free beam of 1000 cells in a row is 1.5e-12."""
_REFINEMENTS = 3  # of a solution with such pivots, each by a factor of about _WEAK
_RESIDUAL = 1e-6
"""Of a solution by pivots on the diagonal: beyond, their signs are not those of the matrix."""


class NoModes(SoftehlError, ArithmeticError):  # noqa: N818 (named after what it is)
    """Error: the eigenvalues asked for do not exist; the message gives the reason."""


@dataclass(frozen=True, eq=False)
class Pivots:
    """Factors of a symmetric matrix with pivots on the diagonal only, as in L D L'.

    negative: number of negative pivots, which is that of negative eigenvalues (Sylvester).
    matrix: (n, n) where the factors are those of a matrix near by.
    """

    factors: Any
    negative: int
    matrix: csc_array | None = None

    @classmethod
    def of(cls, K: csc_array, saddle: Flags | None = None) -> Pivots:
        """Of K, symmetric, (n, n); raises SingularMatrix where pivots on the diagonal fail.

        saddle: (n,) multipliers, whose diagonal may be zero: a small negative number takes its
        place, a small positive one that of other unknowns. This changes no sign.
        """
        weak = np.zeros(K.shape[0]) if saddle is None else _weak(K, saddle)
        shifted = csc_array(K - diags_array(weak)) if weak.any() else K
        try:
            factors = sparse_linalg.splu(
                without_zeros(shifted),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularMatrix(f"no LU factors: {error}") from error
        if not np.array_equal(factors.perm_r, factors.perm_c):
            raise SingularMatrix("a pivot on the diagonal is zero")
        negative = int((factors.U.diagonal() < 0.0).sum())
        pivots = cls(factors, negative, K if weak.any() else None)
        b = np.random.default_rng(0).uniform(-1.0, 1.0, K.shape[0])
        x = pivots.solve(b)
        scale = np.asarray(abs(K).sum(axis=1)) * np.abs(x).max(initial=0.0) + np.abs(b)
        if not np.abs(K @ x - b).max(initial=0.0) <= _RESIDUAL * scale.max(initial=0.0):
            raise SingularMatrix("the pivots on the diagonal are too weak")
        return pivots

    def solve(self, b: Array) -> Array:
        """x of K x = b, shapes (n,)."""
        x = np.asarray(self.factors.solve(b))
        if self.matrix is not None:
            for _ in range(_REFINEMENTS):
                x = x + self.factors.solve(b - self.matrix @ x)
        return x


def _weak(K: csc_array, saddle: Flags) -> Array:
    """Numbers (n,) that the diagonal of K has too much where it is zero: multipliers get less, and
    displacements beside stresses, and the motion of a rigid body beside its forces, more.
    """
    diagonal, result = np.abs(K.diagonal()), np.zeros(K.shape[0])
    squares, pivots = csc_array(K.multiply(K)), diagonal.copy()
    for mask, sign in ((saddle, 1.0), (~saddle, -1.0)):
        strong = ~mask & (pivots > 0.0)
        stiff = np.divide(1.0, pivots, out=np.zeros_like(diagonal), where=strong)
        pivot = np.asarray(squares @ stiff)
        small = mask & (diagonal < _WEAK * pivot)
        result[small] = sign * _WEAK * pivot[small]
        pivots[small] = pivot[small]  # what is on the diagonal there is rounding
    return result


def lowest(
    K: csc_array, M: csc_array, count: int, saddle: Flags | None = None
) -> tuple[Array, Array]:
    """The algebraically smallest eigenvalues (count,) of K x = w M x, and vectors (count, n).

    K, M: symmetric, (n, n); M positive but for unknowns without mass. saddle: (n,) multipliers
    without mass, each of which makes an eigenvalue of K negative by nature. Vectors have
    x' M x = 1. Raises NoModes, SingularMatrix.
    """
    n, has_mass = K.shape[0], M.diagonal() > 0.0
    heavy = int(has_mass.sum())
    require_count(count, heavy)
    shift, pivots = below(
        lambda shift: Pivots.of(csc_array(K - shift * M), saddle),
        lambda pivots: _nearly_singular(pivots, K),
        float(np.abs(K.diagonal()[has_mass] / M.diagonal()[has_mass]).max()),
        0 if saddle is None else int(saddle.sum()),
    )
    inverse = sparse_linalg.LinearOperator((n, n), matvec=pivots.solve, dtype=np.float64)
    begin = pivots.solve(M @ np.random.default_rng(0).uniform(-1.0, 1.0, n))
    try:
        values, vectors = sparse_linalg.eigsh(
            K, count, M, sigma=shift, OPinv=inverse, v0=begin, ncv=min(n, heavy, 2 * count + 20)
        )
    except sparse_linalg.ArpackError as error:
        raise NoModes(f"{count} modes: {error}") from error
    order = np.argsort(values)
    # once more by the inverse: unknowns without mass follow from the others
    shapes = np.stack([pivots.solve(M @ vectors[:, k]) for k in order])
    sizes = np.sqrt(np.einsum("kn,kn->k", shapes, (M @ shapes.T).T))
    shapes /= sizes[:, None]
    return without_rounding(values[order], terms(K, shapes)), signed(shapes)


def without_rounding(values: Array, terms: Array) -> Array:
    """Eigenvalues (k,) with zeros for those of rigid motions; terms: `terms` of their vectors."""
    return np.where(np.abs(values) <= _NOTHING * terms, 0.0, values)


def terms(K: csc_array, shapes: Array) -> Array:
    """Sums (k,) of the magnitudes of the terms of x' K x, of vectors (k, n)."""
    return np.asarray(np.einsum("kn,kn->k", np.abs(shapes), (abs(K) @ np.abs(shapes.T)).T))


def require_count(count: int, heavy: int) -> None:
    """Raise NoModes if more modes are asked for than unknowns have mass."""
    if heavy < 2:
        raise NoModes(f"{count} modes: of the unknowns that have a mass {heavy} can move")
    if not 0 < count < heavy:
        raise NoModes(f"{count} modes: from 1 to {heavy - 1} are possible here")


class Counted(Protocol):
    """Factors with the number of negative eigenvalues."""

    @property
    def negative(self) -> int:
        """See `Pivots`."""
        ...


P = TypeVar("P", bound=Counted)


def below(
    pivots_of: Callable[[float], P], singular: Callable[[P], bool], ratio: float, saddle: int
) -> tuple[float, P]:
    """A shift w below all eigenvalues, zero if it can be, and factors of K - w M.

    singular: tells of factors of K whether it nearly is. ratio: largest of the diagonals. saddle:
    number of eigenvalues that are negative by nature. Raises NoModes.
    """
    shift, reason = 0.0, ""
    for k in range(_SHIFTS + 1):
        try:
            pivots = pivots_of(shift)
            nearly_singular = k == 0 and singular(pivots)
            if pivots.negative == saddle and not nearly_singular:
                return shift, pivots
            reason = f"{pivots.negative - saddle} eigenvalues below {shift:.3g}"
        except SingularMatrix as error:
            reason = str(error)
        shift = -_SMALL_SHIFT * 100.0**k * ratio
    raise NoModes(f"no shift below all eigenvalues was found: {reason}")


def _nearly_singular(pivots: Pivots, K: csc_array) -> bool:
    """True if a motion costs no more than rounding: a body that is free."""
    b = np.random.default_rng(1).uniform(-1.0, 1.0, K.shape[0])
    x = pivots.solve(b)
    size = np.asarray(abs(K) @ np.abs(x))
    return bool(np.abs(b).max() <= 1e-11 * size.max())


def smallest_factors(K: csc_array, G: csc_array, count: int) -> tuple[Array, Array]:
    """The smallest positive f of (K + f G) x = 0, rising, at most `count`, and vectors (., n).

    K, G: symmetric, (n, n), K regular; it may have multipliers. Vectors have 1 as their largest
    entry. Raises NoModes where there are none, SingularMatrix.
    """
    n = K.shape[0]
    if not 0 < count < n - 1:
        raise NoModes(f"{count} buckling factors: from 1 to {n - 2} are possible here")
    if not G.data.any():
        raise NoModes("the stiffness does not change with the load, as in laws of small strains")
    try:
        factors = sparse_linalg.splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01)
    except RuntimeError as error:
        raise SingularMatrix(f"no LU factors: {error}") from error
    action = sparse_linalg.LinearOperator(
        (n, n), matvec=lambda x: -factors.solve(G @ x), dtype=np.float64
    )
    begin = np.random.default_rng(0).uniform(-1.0, 1.0, n)
    n_requested = min(n - 2, count)
    try:
        inverse, vectors = sparse_linalg.eigs(
            action, n_requested, which="LR", v0=begin, ncv=min(n, 3 * n_requested + 20)
        )
    except sparse_linalg.ArpackError as error:
        raise NoModes(f"{count} buckling factors: {error}") from error
    factors_found, order = buckling_factors(inverse)
    shapes = signed(vectors[:, order].real.T)
    return factors_found, shapes / np.abs(shapes).max(axis=1, keepdims=True)


def buckling_factors(inverse: Any) -> tuple[Array, Integers]:
    """Positive factors, rising, of which these complex numbers are the inverses; and their places.

    Raises NoModes where there are none.
    """
    real = np.flatnonzero((inverse.real > 0.0) & (np.abs(inverse.imag) <= 1e-6 * inverse.real))
    if not len(real):
        raise NoModes("no factor of these loads buckles it: they pull, or nothing is slender")
    order = real[np.argsort(-inverse.real[real])]
    return 1.0 / inverse.real[order], order


def nearest_zero(K: csc_array) -> tuple[float, Array]:
    """The eigenvalue of K, symmetric (n, n), nearest to zero, and its vector of length 1.

    Raises SingularMatrix.
    """
    n = K.shape[0]
    if n < _DENSE:
        every, columns = np.linalg.eigh(K.toarray())
        index = int(np.abs(every).argmin())
        return float(every[index]), signed(columns[:, [index]].T)[0]
    shift = 0.0
    try:
        pivots = Pivots.of(K)
    except SingularMatrix:  # a little beside it is not
        shift = _BESIDE * float(np.abs(K.data).max())
        pivots = Pivots.of(csc_array(K - shift * eye_array(n, format="csc")))
    inverse = sparse_linalg.LinearOperator((n, n), matvec=pivots.solve, dtype=np.float64)
    begin = np.random.default_rng(0).uniform(-1.0, 1.0, n)
    values, vectors = sparse_linalg.eigsh(K, 1, sigma=shift, OPinv=inverse, v0=begin)
    return float(values[0]), signed(vectors.T)[0]


def highest(
    apply: Callable[[Array], Array],
    begin: Array,
    dot: Callable[[Array, Array], float],
    accuracy: float,
) -> float:
    """The highest eigenvalue of a symmetric operator, by Lanczos' method, to a relative accuracy.

    begin: a random vector (n,). dot: of two vectors, which may be spread over processes.
    """
    v, previous = begin / np.sqrt(dot(begin, begin)), np.zeros_like(begin)
    alphas, betas = list[float](), list[float]()
    while True:
        w = apply(v) - (betas[-1] if betas else 0.0) * previous
        alphas.append(dot(w, v))
        w -= alphas[-1] * v
        betas.append(float(np.sqrt(dot(w, w))))
        values, vectors = eigh_tridiagonal(np.array(alphas), np.array(betas[:-1]))
        top = float(values[-1])
        if betas[-1] * abs(vectors[-1, -1]) <= accuracy * abs(top):
            return top
        previous, v = v, w / betas[-1]


def signed(vectors: Array) -> Array:
    """Vectors (k, n) with their largest entry positive."""
    rows = np.arange(len(vectors))
    largest = vectors[rows, np.abs(vectors).argmax(axis=1)]
    return vectors * np.where(largest < 0.0, -1.0, 1.0)[:, None]
