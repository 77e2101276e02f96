"""The cube of `benchmarks.hex8`: places, elements, displacements. It needs NumPy alone."""

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]
MU, K = 0.4225, 0.9154166666666667
SIGNS = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def mapped(x: Values) -> Values:
    """Places of the nodes of a regular lattice."""
    return x + 0.02 * np.sin(5 * x[:, ::-1])


def displacement(x: Values) -> Values:
    """Displacements of the nodes."""
    return 0.05 * np.sin(3 * np.roll(x, 1, axis=1) + np.arange(3))


def direction(x: Values) -> Values:
    """Vector with which the tangent is multiplied."""
    return np.cos(2 * np.roll(x, -1, axis=1) - np.arange(3))


def cube(n: int) -> tuple[Values, npt.NDArray[np.int64]]:
    """Lattice (nodes, 3) and elements (n^3, 8)."""
    s = np.linspace(0, 1, n + 1)
    x = np.stack(np.meshgrid(s, s, s, indexing="ij"), axis=-1).reshape(-1, 3)
    at = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    corners = (SIGNS + 1) // 2
    cells = [at[a : n + a, b : n + b, c : n + c].ravel() for a, b, c in corners]
    return x, np.stack(cells, axis=1)
