"""Whole solutions on an emulated device: those of the matrix-free engine; what is refused."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import MatrixFree, Mesh, Study
from softehl.device_source import DeviceSource
from softehl.runtime.device import device_block
from softehl.runtime.device.device_module import EmulatedModule
from softehl.runtime.study import StudyError
from tests.device.test_device_kernels import GIVEN, page


def sheared(law: str, order: int, cells: int) -> Study:
    mesh = Mesh.box(1, 1, 1, cells=(cells,) * 3, order=order)
    study = Study(mesh.map(lambda x: x + 0.02 * np.sin(5 * x[:, ::-1])))
    given: dict[str, Any] = dict(GIVEN[law])
    study.add("body", page(law), **given)
    study.fix("bottom", u_x=0, u_y=0, u_z=0)
    study.fix("top", u_x=0.1, u_y=0, u_z=0)
    return study


@pytest.mark.parametrize(
    ("law", "order", "cells"),
    [
        ("neo_hooke", 1, 4),
        pytest.param("plastic", 1, 4, marks=pytest.mark.slow),
        pytest.param("neo_hooke", 2, 8, marks=pytest.mark.slow),
        pytest.param("neo_hooke", 3, 2, marks=pytest.mark.slow),
        pytest.param("neo_hooke", 4, 2, marks=pytest.mark.slow),
    ],
)
def test_the_solution_of_the_host(law: str, order: int, cells: int) -> None:
    results = [
        sheared(law, order, cells).solve(steps=2, linear="matrix-free", device=device)
        for device in (None, "emulated")
    ]
    for name in ("u_x", "u_y", "u_z"):
        there, here = (r.values(name) for r in results)
        assert here == pytest.approx(there, abs=1e-11)


@pytest.mark.parametrize(
    ("law", "order", "cells"),
    [("neo_hooke", 1, 4), pytest.param("neo_hooke", 2, 3, marks=pytest.mark.slow)],
)
def test_mixed_precision_takes_the_same_iterations(law: str, order: int, cells: int) -> None:
    engines = [MatrixFree(device="emulated", precision=p) for p in ("double", "mixed")]
    results = [sheared(law, order, cells).solve(engine=e) for e in engines]
    assert [*map(len, (e.iterations for e in engines))] == [len(engines[0].iterations)] * 2
    pairs = zip(*(e.iterations for e in engines), strict=True)
    assert all(abs(a - b) <= 1 for a, b in pairs), engines
    here, there = (r.values("u_x") for r in results)
    assert there == pytest.approx(here, abs=1e-11)


class There(np.ndarray[Any, Any]):
    """An array of a device: NumPy's functions take no arrays of the host beside it."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        out = options.get("out", ())
        for a in (*inputs, *out):
            assert isinstance(a, There) or np.ndim(a) == 0, f"{ufunc} of an array of the host"
        bare = [np.asarray(a) if isinstance(a, There) else a for a in inputs]
        if out:
            options["out"] = tuple(np.asarray(a) for a in out)
        result = getattr(ufunc, method)(*bare, **options)
        return out[0] if out else np.asarray(result).view(There)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        allowed = (np.where, np.empty_like, np.zeros_like, np.dot, np.linalg.norm)
        assert function in allowed, f"{function} is not known to work with CuPy"
        arrays = [a for a in args if isinstance(a, np.ndarray)]
        assert all(isinstance(a, There) or a.ndim == 0 for a in arrays), function
        bare = [np.asarray(a) if isinstance(a, There) else a for a in args]
        return np.asarray(function(*bare, **options)).view(There)


class Matrix:
    """A sparse matrix there."""

    def __init__(self, A: Any) -> None:
        self.A = A

    def __matmul__(self, x: Any) -> Any:
        assert isinstance(x, There)
        return np.asarray(self.A @ np.asarray(x)).view(There)


class StrictModule(EmulatedModule):
    """An emulated device whose arrays do not mix with those of the host."""

    def __init__(self, source: DeviceSource) -> None:
        super().__init__(source)
        self.launched: dict[str, int] = {}
        self.moved: list[tuple[str, int]] = []

    def launch(self, kernel: str, n: int, arrays: Any, *, backwards: bool = False) -> None:
        assert all(a is None or isinstance(a, There) for a in arrays), kernel
        reals = {str(a.dtype) for a in arrays if a is not None and a.dtype.kind == "f"}
        assert reals == {self.source.real}, kernel
        self.launched[kernel] = self.launched.get(kernel, 0) + 1
        super().launch(kernel, n, [a if a is None else np.asarray(a) for a in arrays])

    def array(self, a: Any) -> Any:
        assert not isinstance(a, There)
        self.moved.append(("up", np.size(a)))
        return np.array(a, order="C").view(There)

    def zeros(self, *shape: int) -> Any:
        return np.zeros(shape, dtype=self.source.real).view(There)

    def host(self, a: Any) -> Any:
        assert isinstance(a, There)
        self.moved.append(("down", a.size))
        return np.array(np.asarray(a))

    def sparse(self, A: Any) -> Any:
        self.moved.append(("matrix", A.nnz))
        return Matrix(A)


@pytest.mark.parametrize(("loaded", "precision"), [(False, "mixed"), (True, "double")])
def test_arrays_of_host_and_device_do_not_mix(
    loaded: bool, precision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A GPU is not at hand: arrays that refuse each other stand for those of NumPy and CuPy."""
    study = sheared("neo_hooke", 2, 3)
    if loaded:
        study.spring("right", u_y=0.3)
        study.tie("left", "right", "u_z")
    expected = study.solve(linear="matrix-free")
    made: list[StrictModule] = []

    def strict(source: DeviceSource, device: str) -> StrictModule:
        made.append(StrictModule(source))
        return made[-1]

    monkeypatch.setattr(device_block, "device_module", strict)
    result = study.solve(engine=MatrixFree(device="cuda", precision=precision))
    assert result.values("u_x") == pytest.approx(expected.values("u_x"), abs=1e-11)
    assert sum(sum(m.launched.values()) for m in made) > 100
    assert made[0].launched["geometry"] == 1
    steps, n = made[0].launched["moduli"], result.system.size
    moved = [(k, count) for m in made for k, count in m.moved if count >= n or k == "matrix"]
    # the state, the diagonal and the right-hand side; residual, magnitudes, diagonal and increment
    own = 0 if not loaded else 2 * steps  # products with ties, of vectors of the host
    assert moved.count(("up", n)) <= 3 * steps + 5 + own
    assert moved.count(("down", n)) <= 5 * steps + 5 + 2 * own
    # two interpolations once, and the loads; else only values of the matrix of the lower order
    assert len([k for k, _ in moved if k == "matrix"]) == 2 + loaded * steps
    assert made[0].launched["residual"] >= steps


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"linear": "matrix-free", "device": "gpu"}, "allowed are"),
        ({"device": "cuda"}, 'a device needs linear = "matrix-free"'),
        ({"linear": "matrix-free", "device": "cuda", "engine": "petsc"}, 'leave engine = "petsc"'),
        ({"linear": "matrix-free", "device": "cuda"}, "pip install 'softehl[cuda]'"),
    ],
)
def test_what_is_refused(options: dict[str, Any], words: str) -> None:
    if "pip" in words and importlib.util.find_spec("cupy") is not None:
        pytest.skip("CuPy is installed")
    with pytest.raises(StudyError) as error:
        sheared("neo_hooke", 1, 1).solve(**options)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_precision_that_cannot_work_is_refused() -> None:
    with pytest.raises(StudyError, match='"mixed": the kernels of the processor are in double'):
        MatrixFree(precision="mixed")
    with pytest.raises(StudyError, match="allowed are 'double', 'mixed'"):
        MatrixFree(precision="single", device="cuda")


def test_a_page_with_data_is_refused() -> None:
    @softehl.page
    def given(m: Any) -> None:
        T = m.scalar("T")
        (k,) = m.data(k="conductivity")
        m.weak(k * m.grad(T), m.grad(T))
        m.offer(product=True)

    study = Study(Mesh.rectangle(1, 1, cells=(2, 2)))
    study.add("plate", given, k=1.0)
    with pytest.raises(StudyError, match="a device knows parameters and history only"):
        study.solve(linear="matrix-free", device="emulated")
