"""Rigid bodies: nodes that move with one, a moment on one, and a point against its surface."""

from __future__ import annotations

from tests.reference.differentiate import Arguments, Matrix, Number, Vector, mp, mpf


def link(a: Arguments, dofs: Vector) -> Number:
    """lambda . (u - U - (R - 1) (X - a)), N mm."""
    d = 2 if len(dofs) == 7 else 3
    u, force, U, theta = dofs[:d], dofs[d : 2 * d], dofs[2 * d : 3 * d], dofs[3 * d :]
    arm = [a.X[c] - a.data[c] for c in range(d)]
    finite, turned = a.data[d], _times(rotation(theta), arm)
    small = [-theta[0] * arm[1], theta[0] * arm[0]] if d == 2 else _cross(theta, arm)
    moved = [finite * (turned[c] - arm[c]) + (1 - finite) * small[c] for c in range(d)]
    return _dot(force, [u[c] - U[c] - moved[c] for c in range(d)])


def moment(a: Arguments, dofs: Vector) -> Vector:
    """Minus the moment times the spin of each change of the rotation vector."""
    return [-v for v in _by_vector(dofs, a.data)]


def touch(a: Arguments, dofs: Vector) -> Vector:
    """Forces on the point and, with the opposite sign and their moment, on the body."""
    d = 2 if len(dofs) == 7 else 3
    data = list(a.data)
    rho, friction, depth = data[:3]
    reference, old, area = data[3 : 3 + d], data[3 + d : 3 + 2 * d], data[3 + 2 * d]
    flat, side, radius = data[4 + 2 * d : 7 + 2 * d]
    c, n = data[7 + 2 * d : 7 + 3 * d], data[7 + 3 * d :]
    x, lam = dofs[:d], dofs[d]
    shears = 1 if d == 2 else 3
    tau, rest = dofs[d + 1 : d + 1 + shears], dofs[d + 1 + shears :]
    U, theta = rest[:d], rest[d:]
    R = rotation(theta)
    arm = [x[k] - reference[k] - U[k] for k in range(d)]
    y = [reference[k] + v for k, v in enumerate(_times(_transposed(R), arm))]
    if flat:
        gap, normal = _dot(n, [y[k] - c[k] for k in range(d)]), n
    else:
        apart = [y[k] - c[k] for k in range(d)]
        across = [apart[k] - _dot(n, apart) * n[k] for k in range(d)]
        length = mp.sqrt(_dot(across, across))
        gap, normal = side * (length - radius), [side * v / length for v in across]
    found = [mpf(0)] * len(dofs)
    trial = lam - rho * gap
    if trial < 0:
        return found
    p = trial if gap > -depth else mpf(0)
    slip = [y[k] - old[k] for k in range(d)]
    if d == 2:
        along = [normal[1], -normal[0]]
        q = max(-friction * p, min(friction * p, tau[0] + rho * _dot(along, slip)))
        shear, means = [q * v for v in along], [q]
    else:
        stick = [t + rho * s for t, s in zip(_times(_transposed(R), tau), slip, strict=True)]
        shear = [s - _dot(stick, normal) * v for s, v in zip(stick, normal, strict=True)]
        size = mp.sqrt(_dot(shear, shear))
        if size > friction * p:
            shear = [v * friction * p / size for v in shear]
        means = _times(R, shear)
    force = _times(R, [area * (shear[k] - p * normal[k]) for k in range(d)])
    if d == 2:
        turning = [arm[0] * force[1] - arm[1] * force[0]]
    else:
        turning = _by_vector(theta, _cross(arm, force))
    found[:d], found[d] = force, area * p / rho
    found[d + 1 : d + 1 + shears] = [area * v / rho for v in means]
    found[d + 1 + shears :] = [-v for v in (*force, *turning)]
    return found


def rotation(theta: Vector) -> Matrix:
    """Rotation by an angle, or by a vector: the sum of the powers of its skew matrix."""
    if len(theta) == 1:
        c, s = mp.cos(theta[0]), mp.sin(theta[0])
        return [[c, -s], [s, c]]
    return _series(theta, 0)


def _by_vector(theta: Vector, M: Vector) -> Vector:
    """Work of a moment on each component: the sum of powers over (k + 1)! transposed, times it."""
    return _times(_transposed(_series(theta, 1)), M)


def _series(theta: Vector, shift: int) -> Matrix:
    """Sum of S^k / (k + shift)! of the skew matrix S."""
    x, y, z = theta
    S = [[mpf(0), -z, y], [z, mpf(0), -x], [-y, x, mpf(0)]]
    term = [[mpf(int(i == j)) for j in range(3)] for i in range(3)]
    total = [list(row) for row in term]
    for k in range(1, 150):
        columns = _transposed(S)
        term = [[_dot(row, column) / (k + shift) for column in columns] for row in term]
        total = [
            [a + b for a, b in zip(r, t, strict=True)] for r, t in zip(total, term, strict=True)
        ]
    return total


def _transposed(A: Matrix) -> Matrix:
    return [list(column) for column in zip(*A, strict=True)]


def _times(A: Matrix, v: Vector) -> Vector:
    return [_dot(row, v) for row in A]


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def _dot(a: Vector, b: Vector) -> Number:
    return sum((v * w for v, w in zip(a, b, strict=True)), mpf(0))
