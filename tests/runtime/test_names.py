"""Names that a result does not have: one line with those that it has."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from softehl import Mesh, SoftehlError, Study


@pytest.fixture(scope="module")
def result() -> Any:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("rubber", material="hooke", E=10.0, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    return next(study.march(dt=1.0, until=1.0, method="newmark", mass={"rubber": {"rho": 1.0}}))


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda r: r.at_nodes("ruber"),
            "no block 'ruber' (did you mean 'rubber'?); there are rubber",
        ),
        (lambda r: r.fields("steel"), "no block 'steel'; there are rubber"),
        (
            lambda r: r.values("u_z"),
            "no unknown 'u_z' (did you mean 'u_x' or 'u_y'?); there are u_x, u_y",
        ),
        (
            lambda r: r.values("sigma_xx"),
            "no unknown 'sigma_xx', but a field: fields('rubber')['sigma_xx'] has it at the "
            "points, at_nodes('rubber')['sigma_xx'] at the nodes",
        ),
        (lambda r: r.gathered("p"), "no unknown 'p' at nodes; there are u_x, u_y"),
        (lambda r: r.velocity("p"), "no unknown 'p'; at nodes: u_x, u_y"),
        (lambda r: r.problem.assembler.block("a"), "no block 'a'; there are rubber, "),
    ],
)
def test_a_name_that_is_not_there(result: Any, ask: Callable[[Any], object], message: str) -> None:
    with pytest.raises(KeyError) as caught:
        ask(result)
    assert isinstance(caught.value, SoftehlError)
    assert str(caught.value).startswith(message)
