"""Numbers of unknowns by name: at nodes, of elements, shared, and along elements."""

import numpy as np
import pytest

from softehl.runtime.discretisation.dofmap import ElementUnknowns, Numbering, Slot

CHAIN = np.array([[0, 1], [1, 2]])
DISPLACED = tuple(Slot(name, node) for node in (0, 1) for name in ("u", "w"))


def test_unknowns_of_a_field_are_numbered_node_by_node() -> None:
    body = ElementUnknowns("body", CHAIN, (*DISPLACED, Slot("force", None)), frozenset({"force"}))
    plain = Numbering.of(4, [body])
    assert plain.layout.names == ("u", "w", "force")
    assert plain.dofs["body"].tolist() == [[0, 3, 1, 4, 6], [1, 4, 2, 5, 6]]
    fields = {"hold": ("force",), "nobody has it": ("q",), "displacement": ("u", "w")}
    together = Numbering.of(4, [body], fields)
    assert (together.layout.names, together.layout.counts) == (("hold", "displacement"), (1, 6))
    assert together.dofs["body"].tolist() == [[1, 2, 3, 4, 0], [3, 4, 5, 6, 0]]
    assert together.nodal["w"].tolist() == [2, 4, 6, -1]
    assert together.at(("u", "w"), CHAIN).tolist() == together.rows("body", "displacement").tolist()


def test_fields_along_elements_have_unknowns_at_places_that_blocks_share() -> None:
    """Pressures of order 2 that are continuous, and an element at each of their places."""
    film = ElementUnknowns("film", CHAIN, DISPLACED, along={"p": np.array([[0, 1, 2], [2, 3, 4]])})
    each = ElementUnknowns(
        "each", np.empty((5, 0), np.int64), (), along={"p": np.arange(5)[:, None]}
    )
    found = Numbering.of(3, [film, each])
    assert found.layout.counts == (3, 3, 5)
    assert found.rows("film", "p").tolist() == [[6, 7, 8], [8, 9, 10]]
    assert found.dofs["film"][:, 4:].tolist() == found.rows("film", "p").tolist()
    assert found.dofs["each"][:, 0].tolist() == [6, 7, 8, 9, 10]


@pytest.mark.parametrize(
    ("second", "fields", "words"),
    [
        (
            ElementUnknowns("b", CHAIN, (Slot("u", None),)),
            None,
            "u: an unknown of nodes in one block",
        ),
        (ElementUnknowns("b", CHAIN, (), along={"u": CHAIN}), None, "u: an unknown of nodes"),
        (
            ElementUnknowns("b", CHAIN, (Slot("p", None),), along={"p": CHAIN}),
            None,
            "p: an unknown of elements and a field along them",
        ),
        (ElementUnknowns("b", CHAIN, (Slot("p", None),)), {"f": ("u", "p")}, "not all at nodes"),
        (
            ElementUnknowns("b", CHAIN, (Slot("p", None),)),
            {"p": ("u", "w")},
            "is not in it has this name",
        ),
    ],
)
def test_names_that_do_not_fit_together_are_refused(
    second: ElementUnknowns, fields: dict[str, tuple[str, ...]] | None, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Numbering.of(3, [ElementUnknowns("a", CHAIN, DISPLACED), second], fields)
