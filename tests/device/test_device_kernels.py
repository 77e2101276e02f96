"""Device kernels, emulated: the same numbers as the kernels in C; barriers; single precision."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import csr_array

import softehl
from benchmarks.field_pages import MATERIALS
from softehl import Mesh, Study
from softehl.device_arrays import numbered
from softehl.device_source import DeviceSource
from softehl.runtime.arrays import Array
from softehl.runtime.device.device_block import (
    DeviceBlock,
    SparsePattern,
    load_module,
    unknowns_by_order,
)
from softehl.runtime.device.device_module import EmulatedModule
from softehl.runtime.discretisation.matrix_free_products import lexicographic
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.mesh.cells import CELLS

GIVEN: dict[str, dict[str, float]] = {
    "neo_hooke": {"mu": 0.4, "K": 0.9},
    "plastic": {"G": 0.4, "K": 0.9, "H": 0.1, "limit": 0.01},
    "viscous": {"mu": 0.4, "K": 0.9, "G": 0.6, "tau": 2.0, "dt": 0.1},
    "advection": {"k": 0.7, "speed": 2.0},
    "springs": {"E": 0.8, "bed": 1.5},
    "ring": {"mu": 0.4, "K": 0.9},
    "mixed": {"mu": 0.4, "K": 0.9},
    "convection": {"nu": 0.3, "speed": 2.0},
}


def page(law: str) -> Any:
    """A page of these laws, one that is not symmetric, and one of two dimensions with values."""
    if law in MATERIALS:

        @softehl.page
        def material(m: Any) -> None:
            MATERIALS[law].page().write(m)
            m.offer(product=True)

        return material
    if law == "advection":

        @softehl.page
        def advection(m: Any) -> None:
            """Conduction that depends on the temperature and the place, with a flow."""
            T = m.scalar("T")
            k, speed = m.parameters(k="conductivity", speed="speed")
            x = m.position
            m.weak(k * (1 + T**2 + x[0]) * m.grad(T), m.grad(T))
            m.weak(speed * m.grad(T)[0], T)
            m.offer(product=True)

        return advection

    if law == "mixed":

        @softehl.page
        def mixed(m: Any) -> None:
            """Rubber with a pressure of order 1, and one number of each cell."""
            u, p, s = m.vector("u"), m.scalar("p", order=1), m.scalar("s", order=0)
            mu, K = m.parameters(mu="shear modulus", K="bulk modulus")
            F = m.deformation_gradient(u)
            J = m.define("J", F.det())
            W = mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * K)
            m.minimise(W + s**2 + s * (J - 1) ** 2 / 2 + m.grad(p).norm() ** 2 / 10)

        return mixed

    if law == "convection":

        @softehl.page
        def convection(m: Any) -> None:
            """Taylor-Hood: a viscous flow with inertia, and not symmetric."""
            v, p = m.vector("v"), m.scalar("p", order=1)
            nu, speed = m.parameters(nu="viscosity", speed="of the inflow")
            L = m.grad(v)
            m.weak(nu * L, L)
            m.weak(L * v + speed * p * v, v)
            m.weak(-p, L.trace())
            m.weak(L.trace(), p)

        return convection

    @softehl.page
    def springs(m: Any) -> None:
        """A sheet on a bed of springs that harden, at large displacements."""
        u = m.vector("u")
        E, bed = m.parameters(E="stiffness", bed="of the springs")
        F = m.deformation_gradient(u)
        J = m.define("J", F.det())
        W = E / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + (J - 1) ** 2
        m.minimise(W + bed * (u.dot(u) + u.dot(u) ** 2) / 2)
        m.offer(product=True)

    return springs


@dataclass
class Case:
    """A block of distorted cells at a random state, its device and its vectors."""

    law: str
    cell: str
    cells: int
    real: str = "double"

    def __post_init__(self) -> None:
        kind = CELLS[self.cell]
        self.order, D = kind.order, kind.dimension
        make: Any = Mesh.box if D == 3 else Mesh.rectangle
        mesh = make((1.0,) * D, cells=(self.cells,) * D, order=self.order)
        mesh = mesh.map(lambda x: 1.0 + x + 0.02 * np.sin(5 * x[:, ::-1]))
        ring = self.law == "ring"
        study = Study(mesh, geometry="axisymmetric" if ring else None)
        given: dict[str, Any] = dict(GIVEN[self.law])
        study.add("body", page("neo_hooke" if ring else self.law), **given)
        system = study.system()
        self.assembler, self.parameters = system.assembler, np.array([*GIVEN[self.law].values()])
        block, kernel = self.assembler.block("body"), self.assembler.block("body").kernel
        assert isinstance(kernel, Kernel)
        rng = np.random.default_rng(1)
        self.x = 0.02 / self.cells * rng.uniform(-1, 1, system.size)
        self.v = rng.uniform(-1, 1, system.size)
        if kernel.point_data:
            points = len(kernel.default_rule.weights)
            shape = len(block.dofs), points, len(kernel.point_data)
            history = 0.005 * rng.uniform(-1, 1, shape)
            if self.law == "plastic":
                history[:, :, 6] = np.abs(history[:, :, 6])
            self.assembler = self.assembler.with_data("body", point_data=history)
            block = self.assembler.block("body")
        self.block = block
        module = load_module(kernel, "emulated", self.real)
        numbers, nodes, unknowns = [], [], []
        for columns in unknowns_by_order(kernel, module.source.fields):
            dofs = block.dofs[:, columns]
            first, inverse = np.unique(dofs[:, :, 0], return_inverse=True)
            nodes.append(inverse.reshape(dofs.shape[:2]))
            of_order = np.empty((len(first), dofs.shape[2]), dtype=np.int64)
            of_order[nodes[-1]] = dofs
            numbers.append(of_order)
            unknowns.append(of_order.ravel())
        counts, components = zip(*(a.shape for a in numbers), strict=True)
        self.nodes, self.first = numbered(nodes, [*counts], [*components])
        self.order_of_device = np.concatenate(unknowns)
        self.position = np.empty(system.size, dtype=np.int64)
        self.position[self.order_of_device] = np.arange(system.size)
        self.device = DeviceBlock.of(block, self.parameters, module, self.position)

    def nodal(self, v: Array) -> Any:
        """A vector of the system in the order of the device."""
        return np.ascontiguousarray(v[self.order_of_device]).astype(self.device.X.dtype)

    def tangent(self) -> Array:
        """K of the kernels in C, in the order of the device."""
        tangents = self.block.tangent(self.x, self.parameters)[1]
        K = np.zeros((len(self.x),) * 2)
        for dofs, k in zip(self.block.dofs, tangents, strict=True):
            K[np.ix_(dofs, dofs)] += k
        order = self.order_of_device
        return K[np.ix_(order, order)]


def difference(a: Any, b: Any) -> float:
    """Greatest difference by the greatest entry."""
    return float(np.abs(a - b).max() / np.abs(b).max())


def differences(case: Case) -> dict[str, float]:
    """Of every kernel to the kernels in C."""
    device, K = case.device, case.tangent()
    u, v = case.nodal(case.x), case.nodal(case.v)
    expected = case.nodal(case.assembler.residual(case.x, {"body": case.parameters}))
    found: dict[str, tuple[Any, Any]] = {}
    actions: dict[str, Callable[[Any], None]] = {
        "residual": lambda y: device.residual(u, y),
        "product": lambda y: device.product(u, v, y),
        "recomputed": lambda y: device.product_recomputed(u, v, y),
        "of moduli": lambda y: device.product_of_moduli(device.moduli(u), v, y),
        "transposed": lambda y: device.product_of_moduli(device.moduli(u), v, y, transposed=True),
        "diagonal": lambda y: device.diagonal(device.moduli(u), y),
    }
    for name, action in actions.items():
        y = np.zeros_like(u)
        action(y)
        right = {"residual": expected, "diagonal": K.diagonal(), "transposed": K.T @ v}
        found[name] = y, right.get(name, K @ v)
    for order in device.module.source.orders:
        P, nodes, first = interpolation(case, order)
        pattern = SparsePattern.of(nodes, first, device.module)
        values = np.zeros(pattern.count, dtype=u.dtype)
        device.assemble(order, device.moduli(u), pattern, values)
        matrix = csr_array((values, pattern.columns, pattern.starts), (P.shape[1],) * 2)
        found[f"order {order}"] = matrix.toarray(), P.T @ K @ P
    return {name: difference(*pair) for name, pair in found.items()}


def interpolation(case: Case, order: int) -> tuple[Any, Any, Any]:
    """From unknowns of an order to those of the cell, nodes of elements, and their unknowns."""
    kind = CELLS[case.cell]
    if order == kind.order:
        return np.eye(len(case.x)), case.nodes, case.first
    components = len(case.device.module.source.fields[0].components)
    shape = case.cell.rstrip("0123456789")
    lower = CELLS[f"{shape}{(order + 1) ** kind.dimension}"]
    fine, coarse = kind.nodes[lexicographic(kind)], lower.nodes[lexicographic(lower)]
    distances = np.linalg.norm(fine[:, None] - coarse[None], axis=2)
    nodes = case.nodes[:, distances.argmin(axis=0)]
    numbers, inverse = np.unique(nodes, return_inverse=True)
    nodes = inverse.reshape(nodes.shape)
    local = lower.shape(fine)[:, lexicographic(lower)]
    P = np.zeros((len(case.first) - 1, len(numbers)))
    for a, b in zip(case.nodes, nodes, strict=True):
        P[np.ix_(a, b)] = local
    unknowns = components * np.arange(len(numbers) + 1)
    return np.kron(P, np.eye(components)), nodes, unknowns


QUICK = [("neo_hooke", "hex8", 3), ("springs", "quad9", 5), ("convection", "quad9", 3)]
SLOW = [
    *(("neo_hooke", cell, 2) for cell in ("quad4", "hex27", "hex64", "hex125")),
    *(("plastic", cell, 2) for cell in ("hex8", "hex27")),
    *(("advection", cell, 2) for cell in ("quad4", "quad16", "hex8", "hex27")),
    *(("viscous", cell, 2) for cell in ("hex8", "hex27")),
    ("mixed", "quad9", 2),
    ("mixed", "hex8", 2),
    ("convection", "hex27", 2),
]


@pytest.mark.parametrize(
    ("law", "cell", "cells"),
    [*QUICK, *(pytest.param(*case, marks=pytest.mark.slow) for case in SLOW)],
)
def test_the_kernels_in_c_have_the_same_numbers(law: str, cell: str, cells: int) -> None:
    found = differences(Case(law, cell, cells))
    assert max(found.values()) < 1e-13, found


def test_single_precision() -> None:
    found = differences(Case("neo_hooke", "hex8", 2, real="float"))
    assert 1e-8 < max(found.values()) < 3e-5, found


def test_a_ring() -> None:
    """The volume of a ring and its hoop strain need positions at the points."""
    found = differences(Case("ring", "quad4", 3))
    assert max(found.values()) < 1e-13, found


def one_kernel(source: DeviceSource, kernel: str, without: int | None = None) -> DeviceSource:
    """The source with one kernel alone, and one of its barriers left out."""
    (name, text), *headers = source.files.items()
    start, *kernels = re.split(r"(?=^KERNEL)", text, flags=re.MULTILINE)
    (body,) = (k for k in kernels if re.match(rf"KERNEL(_LARGE)?\({kernel},", k))
    if without is not None:
        barriers = [m.span() for m in re.finditer(r"^ *SYNC$", body, re.MULTILINE)]
        first, last = barriers[without]
        body = body[:first] + body[last:]
    return replace(source, files={name: start + body, **dict(headers)})


def barriers(source: DeviceSource, kernel: str) -> int:
    """Number of barriers of a kernel."""
    text = next(iter(one_kernel(source, kernel).files.values()))
    return len(re.findall(r"^ *SYNC$", text, re.MULTILINE))


def by_fibers(case: Case, kernel: str, source: DeviceSource) -> float:
    """Greatest difference of a product by fibers, forwards and backwards."""
    module = EmulatedModule(source, fibers=True)
    device, K = case.device, case.tangent()
    u, v, found = case.nodal(case.x), case.nodal(case.v), []
    moduli = device.moduli(u)
    for backwards in (False, True):
        y = np.zeros_like(u)
        shared = device.parameters, device.history, device.index
        arrays: tuple[Any, ...] = (*shared, device.places, device.X, u, v, y)
        expected = K @ v
        if kernel == "diagonal":
            arrays, expected = (moduli, device.index, y), K.diagonal()
        if kernel == "residual":
            arrays = (*shared, device.places, device.X, u, None, y)
            expected = case.nodal(case.assembler.residual(case.x, {"body": case.parameters}))
        module.launch(kernel, device.n, arrays, backwards=backwards)
        found.append(difference(y, expected) if np.isfinite(y).all() else np.inf)
    return max(found)


@pytest.mark.slow
@pytest.mark.parametrize(("law", "cell"), [("neo_hooke", "hex8"), ("mixed", "quad9")])
@pytest.mark.parametrize("kernel", ["residual", "product", "diagonal"])
def test_every_barrier_is_needed(kernel: str, law: str, cell: str) -> None:
    """But one between sums of slopes along two axes into one array: the order of sums does not
    matter to fibers; on a GPU two threads may add at once.
    """
    case = Case(law, cell, 2)
    source = case.device.module.source
    assert by_fibers(case, kernel, one_kernel(source, kernel)) < 1e-13
    count = barriers(source, kernel)
    unnoticed = [
        k
        for k in range(count)
        if by_fibers(case, kernel, one_kernel(source, kernel, without=k)) < 1e-12
    ]
    sums = 0 if kernel == "diagonal" else source.dimension - 2
    assert len(unnoticed) == sums, (count, unnoticed)
