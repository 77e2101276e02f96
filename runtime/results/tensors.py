"""Invariants of symmetric tensors that are given by their components, such as stresses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array
from softehl.runtime.suggestions import join_names

_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
_EXCHANGED = {"yz": "zy", "xz": "zx", "xy": "yx"}


def von_mises(fields: Mapping[str, Array | float], name: str = "sigma") -> Array:
    """Return the equivalent stress of von Mises, sqrt(3/2 s : s) with the deviator s.

    Parameters
    ----------
    fields : mapping of str to array or float
        Fields of `Result.fields`, `at_nodes`, `at` or `along`: NAME_xx, NAME_yy, NAME_zz, NAME_xy
        and in 3-D NAME_yz, NAME_xz (or NAME_zx).
    name : str
        Name of the tensor.

    Returns
    -------
    array
        In the form of the components.

    Raises
    ------
    UnknownNameError
        A component is missing; a KeyError.
    """
    xx, yy, zz, xy, yz, xz = _components(fields, name)
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.asarray(np.sqrt(normal / 2 + 3 * (xy**2 + yz**2 + xz**2)))


def principal_values(fields: Mapping[str, Array | float], name: str = "sigma") -> Array:
    """Return the principal values of a symmetric tensor.

    Parameters
    ----------
    fields : mapping of str to array or float
        As of `von_mises`.
    name : str
        Name of the tensor.

    Returns
    -------
    array (3, ...)
        The largest first; nan where a component is nan.

    Raises
    ------
    UnknownNameError
        A component is missing; a KeyError.
    """
    xx, yy, zz, xy, yz, xz = _components(fields, name)
    rows = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1)
    defined = np.asarray(np.isfinite(rows).all(axis=-1))
    matrices = np.where(defined[..., None], rows, 0.0).reshape(*xx.shape, 3, 3)
    values = np.where(defined[..., None], np.linalg.eigvalsh(matrices), np.nan)
    return np.asarray(np.moveaxis(values[..., ::-1], -1, 0))


def _components(fields: Mapping[str, Array | float], name: str) -> list[Array]:
    """The six components, as arrays of one shape; shears out of the plane are zero if not given."""
    components = {}
    for c in _COMPONENTS:
        label = f"{name}_{c}"
        label = label if label in fields else f"{name}_{_EXCHANGED.get(c, c)}"
        if label in fields:
            components[c] = np.asarray(fields[label], dtype=np.float64)
    missing = [f"{name}_{c}" for c in ("xx", "yy", "zz", "xy") if c not in components]
    if missing:
        raise UnknownNameError(
            f"no field {join_names(missing)}; there are {join_names(fields)}. Give what "
            f"is missing, such as {{**fields, {missing[0]!r}: 0.0}}"
        )
    return list(np.broadcast_arrays(*(components.get(c, np.zeros(())) for c in _COMPONENTS)))
