"""Rotations of rigid bodies: the matrix of an angle or a rotation vector, and its spin."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Array

_SMALL = 1e-4  # below, terms of fourth order are rounding


def rotation_matrix(theta: Array) -> Array:
    """Rotation (2, 2) by an angle (1,), or (3, 3) by a rotation vector (3,)."""
    if len(theta) == 1:
        c, s = np.cos(theta[0]), np.sin(theta[0])
        return np.array([[c, -s], [s, c]])
    first, second, _ = _factors(theta)
    skew = _skew(theta)
    return np.asarray(np.eye(3) + first * skew + second * skew @ skew)


def spin_by_rotation(theta: Array) -> Array:
    """Spin of a rotation by the change of its vector, (3, 3): delta R R' = skew(S delta theta).

    A moment M works on the rotation vector by S' M.
    """
    _, second, third = _factors(theta)
    skew = _skew(theta)
    return np.asarray(np.eye(3) + second * skew + third * skew @ skew)


def _factors(theta: Array) -> tuple[float, float, float]:
    """sin a / a, (1 - cos a) / a^2 and (a - sin a) / a^3 of the angle a."""
    angle = float(np.linalg.norm(theta))
    if angle < _SMALL:
        square = angle**2
        return 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    sine, cosine = np.sin(angle), np.cos(angle)
    return sine / angle, (1.0 - cosine) / angle**2, (angle - sine) / angle**3


def _skew(theta: Array) -> Array:
    x, y, z = theta
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
