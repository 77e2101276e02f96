"""Target `ufcx` from a material: stress and modulus at the quadrature points of DOLFINx."""

from __future__ import annotations

import json

from softehl.codegen.hosts import c_interface
from softehl.codegen.hosts.c_library import DIFFERENCE, LIMIT
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import VOIGT, is_small_strain, point
from softehl.codegen.hosts.registry import Host, StatesOf
from softehl.codegen.hosts.test_states import Sample, samples
from softehl.codegen.language.material import Law


def module(law: Law, states: StatesOf) -> dict[str, str]:
    """Every file of a material for forms of DOLFINx."""
    interface, small = ElementInterface(point(law)), is_small_strain(law)
    texts, kernel = c_interface.files(interface)
    references = samples(interface, kernel, states(interface.definition))
    substitutions = _substitutions(interface, references[0], small)
    texts[f"{law.name}_dolfinx.py"] = c_interface.filled(
        c_interface.template("dolfinx.py.in"), substitutions
    )
    texts[f"test_{law.name}.py"] = c_interface.filled(
        c_interface.template("dolfinx_test.py.in"), substitutions
    )
    texts["Makefile"] = c_interface.filled(c_interface.template("dolfinx.mk"), substitutions)
    texts["NOTES.md"] = c_interface.filled(c_interface.template("dolfinx.md"), substitutions)
    values = {
        "p": [float(v) for v in references[0].state.parameters],
        "states": [_state(interface, s, small) for s in references],
    }
    texts["samples.json"] = json.dumps(values) + "\n"
    return texts


DOLFINX = Host(material=module)


def _substitutions(interface: ElementInterface, first: Sample, small: bool) -> dict[str, object]:
    d = interface.definition
    pairs = zip(d.parameters, first.state.parameters, strict=True)
    return {
        "name": interface.name,
        "parameter_names": {a.name: a.meaning for a in d.parameters},
        "parameters_given": ", ".join(f"{a.name}={float(v):.3g}" for a, v in pairs),
        "state_names": {a.name: a.meaning for a in d.point_data},
        "state": ", ".join(a.name for a in d.point_data) or "None",
        "small": small,
        "stress": "Stress of the small strain" if small else "First Piola-Kirchhoff stress P of F",
        "field_count": len(d.fields),
        "renewed": [0 if k is None else k for k in interface.renewed],
        "renewed_mask": [k is not None for k in interface.renewed],
        "limit": LIMIT,
        "difference": DIFFERENCE,
    }


def _state(interface: ElementInterface, s: Sample, small: bool) -> dict[str, object]:
    """Displacement gradient, state, and expected values of the material law."""
    values, old = s.state.dofs, [float(v) for v in s.state.point_data[0]]
    new = [v if k is None else s.fields[k] for k, v in zip(interface.renewed, old, strict=True)]

    def tensor(row: list[float], shear: float) -> list[list[float]]:
        components = {
            p: v * (1 if p[0] == p[1] else shear) for p, v in zip(VOIGT, row, strict=True)
        }
        return [[components[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]

    row = [float(v) for v in values]
    if small:
        gradient, stress = tensor(row, 0.5), tensor(s.residual, 1.0)
    else:
        gradient = [[row[3 * i + j] - (i == j) for j in range(3)] for i in range(3)]
        stress = [s.residual[3 * i : 3 * i + 3] for i in range(3)]
    return {"gradient": gradient, "state": old, "stress": stress, "new_state": new}
