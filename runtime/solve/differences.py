"""Backward differences in time: Euler's and BDF2, of steps of any length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softehl.runtime.arrays import Array


def differences(steps: Sequence[float]) -> Array:
    """Weights of d/dt at the newest of two times (backward Euler) or of three (BDF2).

    steps: the last step and, for BDF2, the one before. Newest first.
    """
    dt = steps[0]
    if len(steps) == 1:
        return np.array([1.0, -1.0]) / dt
    r = dt / steps[1]
    return np.array([(1.0 + 2.0 * r) / (1.0 + r), -(1.0 + r), r**2 / (1.0 + r)]) / dt
