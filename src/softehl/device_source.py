"""Device kernels of a page, as text with their sizes: what the compiler gives to the runtime."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NodalFields:
    """Components whose shape functions have one order."""

    components: tuple[str, ...]
    order: int


@dataclass(frozen=True)
class DeviceSource:
    """Text of the kernels of a page on a kind of cell; see `softehl.codegen.emit.device.kernels`.

    files: text by name of the file that is compiled, first, and of its headers. elements: of a
    block of threads. dimension, fields, line: of the cell, of every order in the index of the
    kernels, points along a line. geometry, moduli: numbers of a point that `geometry` and `moduli`
    store. history: numbers of a point. symmetric: whether the tangent is. orders: with which
    matrices are assembled. kernels: name -> number of its arrays. routines: whether a point calls
    some, such as a local iteration. real: type of NumPy of its numbers.
    """

    name: str
    files: dict[str, str]
    elements: int
    threads: int
    dimension: int
    fields: tuple[NodalFields, ...]
    line: int
    geometry: int
    moduli: int
    history: int
    symmetric: bool
    orders: tuple[int, ...]
    kernels: dict[str, int]
    routines: bool = False
    real: str = "float64"

    @property
    def joined(self) -> str:
        """One text, with the header of the device in place of its line."""
        (_, text), (name, header), *_ = self.files.items()
        return text.replace(f'#include "{name}"', header)

    @property
    def points(self) -> int:
        """Points of an element."""
        return int(self.line**self.dimension)

    def blocks(self, n: int) -> int:
        """Blocks of threads for n elements."""
        return -(-n // self.elements)
