"""Weights of networks of pages (`Model.network`): layers, as PyTorch, Flax and lists have them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.run_time_arrays import ArrayDataError, RunTimeArray

Layers: TypeAlias = list[tuple[Array, ...]]
"""Layers: weights (to, from), biases (to,), and, where there are any, weights (to, inputs)."""


@dataclass(frozen=True)
class NetworkShape:
    """Sizes of a network. convex, monotone: see `Model.network`."""

    inputs: int
    layers: tuple[int, ...]
    convex: bool = False
    monotone: bool = False

    @property
    def shapes(self) -> list[list[tuple[int, ...]]]:
        """Shapes of the arrays of every layer."""
        widths = [self.inputs, *self.layers, 1]
        shapes: list[list[tuple[int, ...]]] = []
        for number, (start, to) in enumerate(pairwise(widths)):
            skip = [(to, self.inputs)] if self.convex and number else []
            shapes.append([(to, start), (to,), *skip])
        return shapes

    def flat(self, layers: Layers) -> Array:
        """All numbers in one array."""
        return np.concatenate([part.ravel() for layer in layers for part in layer])

    def split(self, flat: Array) -> Layers:
        """Layers of one array."""
        out: Layers = []
        start = 0
        for shapes in self.shapes:
            parts = []
            for shape in shapes:
                size = int(np.prod(shape))
                parts.append(flat[start : start + size].reshape(shape).copy())
                start += size
            out.append(tuple(parts))
        return out

    @property
    def lower_bounds(self) -> Array:
        """Smallest allowed numbers, flat."""
        rows = []
        for number, shapes in enumerate(self.shapes):
            for k, shape in enumerate(shapes):
                weights = k != 1 and (self.monotone or (self.convex and number > 0 and k == 0))
                rows.append(np.full(int(np.prod(shape)), 0.0 if weights else -np.inf))
        return np.concatenate(rows)


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of a network of a kernel."""

    shape: NetworkShape
    layers: Layers

    @property
    def values(self) -> Array:
        """All numbers, (k,)."""
        return self.shape.flat(self.layers)

    @property
    def numbers(self) -> Array:
        """All numbers, as `values`."""
        return self.values

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Zero for weights that must not be negative."""
        lower_bounds = self.shape.lower_bounds
        return lower_bounds, np.full(len(lower_bounds), np.inf)

    def slope(self) -> None:
        """The unit matrix."""
        return

    def with_values(self, values: Array) -> Weights:
        """Return the network with other weights."""
        return replace(self, layers=self.shape.split(np.asarray(values, dtype=np.float64)))


def initial_weights(
    inputs: int,
    layers: Sequence[int] = (16, 16),
    *,
    convex: bool = False,
    monotone: bool = False,
    seed: int = 0,
) -> Layers:
    """Return random weights, with which the training of a network can start.

    Parameters
    ----------
    inputs : int
        Number of inputs.
    layers : sequence of int
        Widths of the hidden layers.
    convex, monotone : bool
        As of `Model.network`.
    seed : int
        Of the random numbers.

    Returns
    -------
    list of tuple of array
        Of every layer the weights (to, from), the biases (to,) and, if it is convex and not the
        first, the weights (to, inputs) of the inputs.

    Notes
    -----
    Weights are uniform within sqrt(3 / from), so that values keep their size (LeCun et al. 1998),
    or between 0 and 2 / from where they must not be negative; biases are 0.
    """
    shape = NetworkShape(inputs, tuple(layers), convex, monotone)
    rng, out = np.random.default_rng(seed), Layers()
    lower_bounds = shape.split(shape.lower_bounds)
    for shapes, bounds in zip(shape.shapes, lower_bounds, strict=True):
        parts = []
        for size, low in zip(shapes, bounds, strict=True):
            if len(size) == 1:
                parts.append(np.zeros(size))
            elif low.flat[0] == 0.0:
                parts.append(rng.uniform(0.0, 2.0 / size[1], size))
            else:
                width = np.sqrt(3.0 / size[1])
                parts.append(rng.uniform(-width, width, size))
        out.append(tuple(parts))
    return out


def network_layers(
    flat: Array,
    inputs: int,
    layers: Sequence[int] = (16, 16),
    *,
    convex: bool = False,
) -> Layers:
    """Return the layers of weights in one array, such as those that `Study.fit` has found.

    Parameters
    ----------
    flat : array (k,)
        All weights.
    inputs : int
        Number of inputs.
    layers : sequence of int
        Widths of the hidden layers.
    convex : bool
        As of `Model.network`.

    Returns
    -------
    list of tuple of array
        As of `initial_weights`.

    Raises
    ------
    ValueError
        The network has another number of weights.
    """
    shape = NetworkShape(inputs, tuple(layers), convex)
    flat = np.asarray(flat, dtype=np.float64)
    if flat.shape != shape.lower_bounds.shape:
        raise ArrayDataError(f"{flat.shape} weights; this network has {shape.lower_bounds.shape}")
    return shape.split(flat)


def weights_of(array: RunTimeArray, value: Any) -> Weights:
    """Weights of what a user gave.  Raises `ArrayDataError`."""
    options = array.options
    shape = NetworkShape(
        options["inputs"], tuple(options["layers"]), options["convex"], options["monotone"]
    )
    layers = value.layers if isinstance(value, Weights) else _layers(shape, value)
    weights = Weights(shape, layers)
    flat, lower_bounds = weights.values, shape.lower_bounds
    if not np.isfinite(flat).all():
        raise ArrayDataError("the weights are not finite")
    if (flat < lower_bounds).any():
        raise ArrayDataError(
            f"there is the weight {flat[flat < lower_bounds].min():.3g}: those of hidden values "
            "of a convex network, and all of a monotone one, must not be negative"
        )
    return weights


def _layers(shape: NetworkShape, weights: Any) -> Layers:
    """Layers of a list, a mapping of PyTorch or Flax, or one array.  Raises `ArrayDataError`."""
    if isinstance(weights, Mapping):
        weights = _of_mapping(weights)
    expected = [" ".join(str(s) for s in shapes) for shapes in shape.shapes]
    message = (
        f"each of {len(shape.shapes)} layers has weights (to, from) and biases: "
        f"shapes {'; '.join(expected)}"
    )
    if isinstance(weights, np.ndarray) and weights.ndim == 1:
        if weights.shape != shape.lower_bounds.shape:
            raise ArrayDataError(
                f"{message}; given {weights.shape}, or {shape.lower_bounds.shape} in one"
            )
        return shape.split(weights.astype(np.float64))
    if not isinstance(weights, (list, tuple)):
        raise ArrayDataError(f"{message}; given {type(weights).__name__}")
    layers = [tuple(_array(part) for part in layer) for layer in weights]
    actual = [" ".join(str(part.shape) for part in layer) for layer in layers]
    if actual != expected:
        turned = [[part.T.shape for part in layer] for layer in layers]
        hint = ""
        if turned == [[tuple(s) for s in shapes] for shapes in shape.shapes]:
            hint = "; transposed, as kernels of Flax: give its mapping, or W.T"
        raise ArrayDataError(f"{message}; given {'; '.join(actual)}{hint}")
    return layers


def _array(part: Any) -> Array:
    """Numbers of NumPy, JAX or PyTorch."""
    if hasattr(part, "detach"):
        part = part.detach().cpu().numpy()
    try:
        return np.array(part, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArrayDataError(f"{type(part).__name__} is no array of numbers") from None


def _of_mapping(weights: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """Layers of a state_dict of PyTorch or of parameters of Flax, in the order of their numbers."""
    while set(weights) == {"params"}:
        weights = weights["params"]
    if weights and all(isinstance(v, Mapping) for v in weights.values()):
        return [_of_flax(key, weights[key]) for key in sorted(weights, key=_number)]
    stems: dict[str, dict[str, Any]] = {}
    for key, value in weights.items():
        stem, _, kind = str(key).rpartition(".")
        stems.setdefault(stem, {})[kind] = value
    out = []
    for stem, parts in stems.items():
        if not {"weight", "bias"} <= set(parts) or set(parts) - {"weight", "bias", "skip"}:
            raise ArrayDataError(
                f"{stem or 'the mapping'} has {', '.join(map(repr, parts))}; a state_dict "
                "of PyTorch has 'weight' and 'bias' of every layer ('skip' for weights of inputs), "
                "parameters of Flax 'kernel' and 'bias'"
            )
        out.append((parts["weight"], parts["bias"], *([parts["skip"]] if "skip" in parts else [])))
    return out


def _of_flax(key: str, layer: Mapping[str, Any]) -> tuple[Any, ...]:
    """Weights of a layer of Flax, whose kernels are (from, to)."""
    if not {"kernel", "bias"} <= set(layer) or set(layer) - {"kernel", "bias", "skip"}:
        raise ArrayDataError(
            f"layer {key} has {', '.join(map(repr, layer))}; 'kernel' and 'bias' are needed"
        )
    turned = [_array(layer[k]).T for k in ("kernel", "skip") if k in layer]
    return (turned[0], layer["bias"], *turned[1:])


def _number(key: str) -> tuple[str, int]:
    """Key of the order Dense_2, Dense_10."""
    digits = re.search(r"(\d+)$", key)
    return (key[: digits.start()], int(digits[1])) if digits else (key, -1)
