"""Target `abaqus` from the model of an element: a user element (UEL), a deck, a small host."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, patch_mesh
from softehl.codegen.hosts.abaqus_deck import deck, degrees
from softehl.codegen.hosts.element_common import (
    arguments,
    conditions,
    history,
    notes,
    outputs,
    require,
)
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.test_states import samples


def uel(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of a user element."""
    require(interface, "abaqus")
    texts, kernel = c_interface.files(interface, single=True)
    references = samples(interface, kernel, host.with_time_step(interface, states))
    substitutions = _substitutions(interface)
    texts["uel.c"] = c_interface.filled(c_interface.template("uel.c"), substitutions)
    texts["host.f90"] = host.program(interface)
    texts["Makefile"] = c_interface.filled(
        c_interface.template("abaqus.mk"), {**substitutions, "kind": "uel", "host": "host.f90"}
    )
    texts["NOTES.md"] = c_interface.filled(c_interface.template("uel.md"), substitutions)
    texts["samples.txt"] = host.sample_file(interface, references)
    if interface.cell is not None:
        mesh, settings = (
            patch_mesh.patch(interface.cell),
            host.settings_of(interface, references[0]),
        )
        texts["patch.txt"] = host.patch_file(interface, mesh, settings)
        texts[f"{interface.name}.inp"] = deck(interface, mesh, settings)
    return texts


def _substitutions(interface: ElementInterface) -> dict[str, object]:
    return {
        **notes(interface, degrees(interface), "`UNSYMM` in the deck"),
        "order": ", ".join(map(str, interface.by_node())),
        "arguments": "".join(arguments(interface)),
        "conditions": "".join(conditions(interface, "*jelem")),
        "outputs": "".join(outputs(interface, "*nsvars >= STATE + OUTPUT", energy=True)),
        "history": "".join(history(interface, "svars")),
        "variables": interface.variables,
    }
