"""The uniform interface of the kernels: shapes, parameters, rules, batches and their errors."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from softehl.codegen.models import ALL
from softehl.codegen.tools import build
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.quadrature import (
    content_rule,
    facet_rule,
    film_rule,
    gauss,
    rupture_rule,
)
from softehl.runtime.kernels.kernel import (
    ArgumentError,
    Kernel,
    Rule,
    load_kernel,
)
from softehl.runtime.kernels.shared_library import manifest
from tests.codegen.workshop import write
from tests.reference.states import mortar_states, rigid_states, touch_states
from tests.shipped import SHIPPED, VALUES

FAMILIES = tuple(manifest())
SIDES = (*mortar_states(), *touch_states(), *rigid_states())
MATERIAL = np.array([3.04, 0.62, 500.0])
Call = Callable[..., Any]


RULES = {
    None: None,
    "p": film_rule(3),
    "p_minus, p_plus": facet_rule(3),
    "p, p_cell, v_out, v_in": rupture_rule(3),
    "p, v": content_rule(3),
}
"""A rule for every kind of interpolation."""


def arguments(name: str, n: int, rng: np.random.Generator) -> tuple[tuple[Array, Array], Any]:
    """Random admissible arguments for n elements of a family."""
    kernel = load_kernel(name)
    known = next((s for s in SIDES if s.family == name), None)
    if known:
        shaken = (n, len(known.dofs))
        u = np.array(known.dofs) + 1e-3 * rng.uniform(-1, 1, shaken)
        X, data = (np.tile(values, (n, 1)) for values in (known.coordinates, known.data))
        return (X, u), {"parameters": (), "data": data, "rule": None}
    corners = {
        4: [[-0.1, 25.3], [0.1, 25.3], [0.1, 25.5], [-0.1, 25.5]],
        3: [[-0.1, 25.4], [0.0, 25.42], [0.1, 25.45]],
        2: [[-0.1, 25.4], [0.1, 25.45]],
        1: [[0.1, 25.4]],
    }[kernel.nodes]
    X = np.array(corners)[None] + rng.uniform(-0.02, 0.02, (n, kernel.nodes, 2))
    if not kernel.coordinates:
        X = np.empty((n, 0, 0))
    rule = RULES[kernel.interpolated]
    modes = 0 if rule is None or rule.basis is None else rule.basis.shape[1]
    ndof = len(kernel.unknowns) + modes
    u = rng.uniform(-0.01, 0.01, (n, ndof))
    data = rng.uniform(0.5, 1.5, (n, len(kernel.data)))
    named = {"parameters": {p: VALUES[p] for p in kernel.parameters}, "data": data, "rule": rule}
    points = len((rule or kernel.default_rule).weights)
    if kernel.point_data:
        named["point_data"] = rng.uniform(0.5, 1.5, (n, points, len(kernel.point_data)))
    return (X.reshape(n, kernel.nodes * len(kernel.coordinates)), u), named


def methods(kernel: Kernel) -> dict[str, Call]:
    by = {t: partial(kernel.derivative, t[2:]) for t in kernel.tasks if t.startswith("d_")}
    by |= {t: partial(varied, kernel, t) for t in ("pseudo_load", "fields_rate")}
    own = {"fields": "fields_at"}
    return {t: by.get(t) or getattr(kernel, own.get(t, t)) for t in kernel.tasks}


def varied(kernel: Kernel, task: str, X: Array, u: Array, **given: Any) -> Array:
    """A task along the variation in which everything grows alike."""
    width = kernel.nodes * len(kernel.coordinates) + len(kernel.data) + len(kernel.parameters)
    width += np.shape(u)[1] if task == "fields_rate" else 0
    result: Array = getattr(kernel, task)(X, u, np.full((len(u), width), 1e-3), **given)
    return result


def solid(n: int, rng: np.random.Generator) -> tuple[Kernel, Array, Array]:
    (X, u), _ = arguments("solid_q4", n, rng)
    return load_kernel("solid_q4"), X, u


# ----------------------------------------------------------------------------------- description


def test_families_offer_what_the_contract_says() -> None:
    assert set(FAMILIES) == set(SHIPPED)
    for name, shipped in SHIPPED.items():
        kernel = load_kernel(name)
        assert (kernel.nodes, len(kernel.unknowns)) == (shipped.nodes, shipped.unknowns)
        offered = ("energy" in kernel.tasks, "fields" in kernel.tasks)
        assert offered == (shipped.energy, shipped.fields)
    for name in FAMILIES:
        kernel = load_kernel(name)
        assert kernel.name == name
        assert {"residual", "tangent"} <= set(kernel.tasks)
        assert ("fields" in kernel.tasks) == bool(kernel.fields)
        assert len(kernel.signature) == 16
        assert set(kernel.parameters) <= set(VALUES)
        assert load_kernel(name) is kernel


# ----------------------------------------------------------------------------------- good calls


def test_shapes_and_kinds_of_results(rng: np.random.Generator) -> None:
    for name in FAMILIES:
        kernel, n = load_kernel(name), 3
        positional, named = arguments(name, n, rng)
        ndof = positional[1].shape[1]
        points = len((named["rule"] or kernel.default_rule).weights)
        shapes = {
            "energy": [(n,)],
            "residual": [(n, ndof)],
            "tangent": [(n, ndof), (n, ndof, ndof)],
            "fields": [(n, points, len(kernel.fields))],
            "fields_rate": [(n, points, len(kernel.fields))],
        }
        for task, call in methods(kernel).items():
            result = call(*positional, **named)
            arrays = result if isinstance(result, tuple) else (result,)
            assert [a.shape for a in arrays] == shapes.get(task, [(n, ndof)])
            assert all(a.dtype == np.float64 and np.isfinite(a).all() for a in arrays)
            assert all(a.any() for a in arrays)


def test_a_batch_is_exactly_its_elements_one_by_one(rng: np.random.Generator) -> None:
    for name in FAMILIES:
        kernel, n = load_kernel(name), 7
        (X, u), named = arguments(name, n, rng)
        for task, call in methods(kernel).items():
            together = call(X, u, **named)
            for e in range(n):
                one = {**named, "data": named["data"][e : e + 1]}
                if kernel.point_data:
                    one["point_data"] = named["point_data"][e : e + 1]
                alone = call(X[e : e + 1], u[e : e + 1], **one)
                pairs = (
                    zip(together, alone, strict=True) if task == "tangent" else [(together, alone)]
                )
                for many, single in pairs:
                    np.testing.assert_array_equal(many[e], single[0])


def test_no_elements_are_no_error(rng: np.random.Generator) -> None:
    for name in FAMILIES:
        kernel = load_kernel(name)
        positional, named = arguments(name, 0, rng)
        for task, call in methods(kernel).items():
            result = call(*positional, **named)
            assert all(len(a) == 0 for a in (result if task == "tangent" else (result,)))


def written(kernel: Kernel, rng: np.random.Generator) -> set[str]:
    """Arguments that some task of a kernel changes: C gets their addresses, so copies tell."""
    (X, u), named = arguments(kernel.name, 5, rng)
    named["parameters"] = np.array([VALUES[p] for p in kernel.parameters])
    given = {"X": X, "u": u, "data": named["data"], "parameters": named["parameters"]}
    rule = named["rule"] or kernel.default_rule
    given |= {"points": rule.points, "weights": rule.weights}
    if rule.basis is not None:
        given["basis"] = rule.basis
    before = {k: v.copy() for k, v in given.items()}
    for call in methods(kernel).values():
        call(X, u, **named)
    return {k for k, v in given.items() if not np.array_equal(v, before[k])}


def test_arguments_are_not_written(rng: np.random.Generator) -> None:
    assert {name: written(load_kernel(name), rng) for name in FAMILIES} == {
        name: set() for name in FAMILIES
    }


def test_a_kernel_that_writes_its_arguments_is_seen(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    write(ALL["contact"](), tmp_path)
    source = tmp_path / "contact.c"
    called = re.search(r"SOFTEHL_BATCH\(softehl_contact_residual,.*\)", source.read_text())
    assert called
    wrong = """SOFTEHL_KERNEL(softehl_contact_residual)
{
    ((double *)(size_t)dofs)[0] = 7.0, ((double *)(size_t)parameters)[0] = 7.0;
}"""
    source.write_text(source.read_text().replace(called[0], wrong))
    build.build(tmp_path, extra=("-O0",))
    assert written(load_kernel("contact", tmp_path), rng) == {"u", "parameters"}


def test_parameters_by_name_in_any_order(rng: np.random.Generator) -> None:
    kernel, X, u = solid(2, rng)
    by_order = kernel.residual(X, u, parameters=MATERIAL)
    by_name = kernel.residual(X, u, parameters={"kappa": 500.0, "mu_2": 0.62, "mu_1": 3.04})
    np.testing.assert_array_equal(by_order, by_name)
    with_more = kernel.residual(X, u, parameters={**VALUES, "unrelated": 1.0})
    np.testing.assert_array_equal(by_order, with_more)
    np.testing.assert_array_equal(by_order, kernel.residual(X, u, parameters=list(MATERIAL)))
    assert (by_order != kernel.residual(X, u, parameters=MATERIAL[[1, 0, 2]])).any()


def test_views_and_other_number_types_are_converted(rng: np.random.Generator) -> None:
    kernel, X, u = solid(4, rng)
    expected = kernel.residual(X[::2], u[::2].copy(), parameters=MATERIAL)
    views = (np.asfortranarray(X)[::2], np.repeat(u, 2, axis=1)[::2, ::2])
    assert not any(v.flags.c_contiguous for v in views)
    np.testing.assert_array_equal(kernel.residual(*views, parameters=MATERIAL), expected)
    lists = kernel.residual(X[::2].tolist(), u[::2].tolist(), parameters=MATERIAL)
    np.testing.assert_array_equal(lists, expected)
    big_endian = kernel.residual(X[::2].astype(">f8"), u[::2], parameters=MATERIAL)
    np.testing.assert_array_equal(big_endian, expected)
    zeros = kernel.residual(X, np.zeros((4, 8), dtype=int), parameters=MATERIAL)
    np.testing.assert_allclose(zeros, 0.0, atol=1e-11)


def test_the_rule_of_the_call_is_used(rng: np.random.Generator) -> None:
    kernel = load_kernel("film")
    positional, named = arguments("film", 2, rng)
    coarse, fine, finer = (
        kernel.residual(*positional, **{**named, "rule": film_rule(3, "gauss", n)})
        for n in (2, 12, 14)
    )
    np.testing.assert_allclose(fine, finer, rtol=0, atol=1e-5 * np.abs(fine).max())
    assert np.abs(coarse - fine).max() > 1e-3 * np.abs(fine).max()
    values = kernel.fields_at(*positional, **{**named, "rule": film_rule(3, "lobatto", 9)})
    assert values.shape == (2, 9, 8)
    ends = values[:, [0, -1], kernel.fields.index("p")]
    np.testing.assert_allclose(ends, positional[1][:, [4, -1]], rtol=1e-12)


# ----------------------------------------------------------------------------------- bad calls


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"X": (2, 6)}, r"solid_q4: coordinates has shape \(2, 6\), must be \(2, 8\)"),
        ({"X": (3, 8)}, r"coordinates has shape \(3, 8\), must be \(2, 8\)"),
        ({"X": (2, 4, 2)}, r"coordinates has shape \(2, 4, 2\)"),
        ({"u": (2, 9)}, r"dofs has shape \(2, 9\), must be \(2, 8\)"),
        ({"u": (8,)}, r"coordinates has shape \(2, 8\), must be \(8, 8\)"),
        ({"data": (2, 1)}, r"data has shape \(2, 1\), must be \(2, 0\)"),
        ({"parameters": (2,)}, r"parameters has shape \(2,\), must be \(3,\)"),
        ({"parameters": (1, 3)}, r"parameters has shape \(1, 3\), must be \(3,\)"),
    ],
    ids=str,
)
def test_wrong_shapes_are_named(change: dict[str, tuple[int, ...]], message: str) -> None:
    shapes: dict[str, tuple[int, ...]] = {"X": (2, 8), "u": (2, 8), "parameters": (3,), **change}
    X, u, *rest = (np.ones(s) for s in shapes.values())
    named = dict(zip(list(shapes)[2:], rest, strict=True))
    for call in methods(load_kernel("solid_q4")).values():
        with pytest.raises(ArgumentError, match=message):
            call(X, u, **named)


def test_missing_arguments_are_named(rng: np.random.Generator) -> None:
    kernel, X, u = solid(1, rng)
    with pytest.raises(ArgumentError, match=r"^solid_q4 needs mu_2, kappa$"):
        kernel.residual(X, u, parameters={"mu_1": 1.0})
    with pytest.raises(ArgumentError, match=r"parameters has shape \(0,\), must be \(3,\)"):
        kernel.residual(X, u)
    (X, u), named = arguments("contact", 1, rng)
    with pytest.raises(ArgumentError, match=r"contact: data has shape \(1, 0\), must be \(1, 5\)"):
        load_kernel("contact").residual(X, u, parameters=named["parameters"])


def test_a_task_that_is_not_offered_is_named(rng: np.random.Generator) -> None:
    positional, named = arguments("solid_fbar", 1, rng)
    message = "solid_fbar offers residual, tangent, fields, pseudo_load, not energy"
    with pytest.raises(ArgumentError, match=message):
        load_kernel("solid_fbar").energy(*positional, **named)
    positional, named = arguments("contact", 1, rng)
    with pytest.raises(
        ArgumentError, match="contact offers residual, tangent, pseudo_load, not fields"
    ):
        load_kernel("contact").fields_at(*positional, **named)


def test_a_rule_without_a_basis_is_refused(rng: np.random.Generator) -> None:
    kernel = load_kernel("film")
    positional, named = arguments("film", 1, rng)
    for rule in (None, gauss(3)):
        with pytest.raises(ArgumentError, match=r"film interpolates p: .*film_rule"):
            kernel.residual(*positional, **{**named, "rule": rule})


def test_a_rule_for_a_kernel_that_has_its_own_is_refused(rng: np.random.Generator) -> None:
    kernel, X, u = solid(1, rng)
    assert kernel.unrolled
    assert not load_kernel("film").unrolled
    with pytest.raises(ArgumentError, match="rule of solid_q4 is written into it: give none"):
        kernel.residual(X, u, parameters=MATERIAL, rule=kernel.default_rule)


def test_a_rule_of_another_dimension_is_refused(rng: np.random.Generator) -> None:
    positional, named = arguments("film", 0, rng)  # no elements: nothing is read while it fails
    line = film_rule(3)
    plane = Rule(np.column_stack([line.points, line.points]), line.weights, line.basis)
    with pytest.raises(ArgumentError, match="rule"):
        load_kernel("film").residual(*positional, **{**named, "rule": plane})


def test_a_basis_at_other_points_is_refused(rng: np.random.Generator) -> None:
    (X, u), named = arguments("film", 0, rng)
    many, few = film_rule(3, "gauss", 9), film_rule(3, "gauss", 4)
    with pytest.raises(ArgumentError, match="basis"):
        load_kernel("film").residual(
            X, u, **{**named, "rule": Rule(many.points.copy(), many.weights.copy(), few.basis)}
        )


@pytest.mark.parametrize("kind", ["complex", "text", "object"])
def test_values_that_are_no_real_numbers_are_refused(kind: str, rng: np.random.Generator) -> None:
    kernel, X, u = solid(1, rng)
    wrong: Any = {
        "complex": u.astype(complex),
        "text": np.full((1, 8), "a"),
        "object": np.full((1, 8), None),
    }[kind]
    with pytest.raises(ArgumentError, match="dofs"):
        kernel.residual(X, wrong, parameters=MATERIAL)
