"""Response of a material in the measures of a host: stress and modulus from the law's graph.

The deformation moves by six small strains about its value, and the stress of the host is
differentiated along them: so the modulus is exact, and no formula converts it afterwards.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import mpmath
import sympy as sp

from softehl.codegen.abi import TargetError, Task
from softehl.codegen.elements import cells, quadrature
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.traversal import substitute
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.registry import Files, StatesOf
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Argument, Definition, functions_of_user
from softehl.codegen.language.material import Law, Material
from softehl.codegen.language.model import PARENT_NAMES, Model

VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Order of the components; shears of strains count twice."""
_BELOW = [(i, j) for i in range(6) for j in range(i)]


class Measure(StrEnum):
    """Stress and modulus that a host wants."""

    CAUCHY = "Cauchy stress and the modulus of the Jaumann rate of the Kirchhoff stress over J"
    SECOND = "second Piola-Kirchhoff stress and its derivative by the Green strain"
    SMALL = "stress and its derivative by the small strain"


@dataclass(frozen=True)
class MaterialResponse:
    """A material in one measure.

    Its unknowns are F row by row, or six small strains; its fields are the energy (zero for a law
    that has none), 6 stresses, 21 moduli row by row of the upper triangle, or 36, then the fields
    of the law and the new values of its history.
    """

    law: Law
    measure: Measure
    definition: Definition
    written: Definition
    symmetric: bool

    @property
    def interface(self) -> ElementInterface:
        """The response as a model without nodes."""
        return ElementInterface(self.definition)

    @property
    def parameters(self) -> list[Argument]:
        """Constants of the material: all parameters but the length of the step."""
        return self.interface.inputs

    @property
    def first_law_field(self) -> int:
        """Index of the first field of the law itself."""
        return 7 + (21 if self.symmetric else 36)

    def modulus(self, i: int, j: int) -> int:
        """Number of the field that is the modulus in row i and column j."""
        if not self.symmetric:
            return 7 + 6 * i + j
        a, b = min(i, j), max(i, j)
        return 7 + 6 * a - a * (a - 1) // 2 + b - a


def is_small_strain(law: Law) -> bool:
    """True for a law of small strains."""
    return bool(_written(law, sp.eye(3))[1].small)


def _written(law: Law, F: Any) -> tuple[Model, Material]:
    m = Model(law.name, nodes=1, rule=quadrature.point_rule(), doc=law.doc)
    return m, law.on(m, F)


def response(law: Law, measure: Measure) -> MaterialResponse:
    """Return the law in a measure of large strains; small-strain laws stay in theirs."""
    m = Model(law.name, nodes=1, rule=quadrature.point_rule(), doc=law.doc)
    if is_small_strain(law):
        return _small(law, m)
    F0 = sp.Matrix(3, 3, [m.unknown(f"F{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)])
    steps = m.data(**{f"step{i + 1}{j + 1}": "strain from here" for i, j in VOIGT})
    E = _tensor(steps)
    if measure is Measure.CAUCHY:
        F = m.define("F", (sp.eye(3) + E) * F0)
    else:
        inverse = m.define("F0_inverse", F0.adjugate() / F0.det(method="berkowitz"))
        F = m.define("F", F0 + inverse.T * E)
    material = law.on(m, F)
    P = _first(m, material, F)
    if measure is Measure.CAUCHY:
        stress, volume = P * F.T, m.define("J0", F0.det(method="berkowitz"))
    else:
        stress, volume = m.define("F_inverse", F.adjugate() / F.det(method="berkowitz")) * P, 1
    values = [m.define(f"tau_{i}{j}", stress[i, j]) for i, j in VOIGT]
    moduli = [[c / volume for c in m.derivative(f"C_{k}", v, steps)] for k, v in enumerate(values)]
    m.fields(**_named(material, [v / volume for v in values], moduli))
    m.fields(**{f"skew{i}{j}": stress[i, j] - stress[j, i] for i, j in VOIGT[3:]})
    m.example(F11=1, F22=1, F33=1, **{str(s): 0 for s in steps})
    _close(m, material, list(P), list(F))
    d = _ordered(m.finish())
    return MaterialResponse(law, measure, _at_rest(d), d, material.W is not None)


def _tensor(strains: Sequence[Any]) -> Any:
    e = dict(zip(VOIGT, strains, strict=True))
    return sp.Matrix(3, 3, lambda i, j: e[min(i, j), max(i, j)] / (1 if i == j else 2))


def _first(m: Model, law: Material, F: Any) -> Any:
    """First Piola-Kirchhoff stress."""
    return m.define("P", law.P) if law.W is None else m.derivative("P", law.W, F)


def _named(law: Material, stress: Sequence[Any], moduli: Sequence[Sequence[Any]]) -> Any:
    named = {"W": sp.Integer(0) if law.W is None else law.W}
    named |= {f"s{k}": v for k, v in enumerate(stress)}
    start = range(6) if law.W is not None else [0] * 6
    for i, first in enumerate(start):
        named |= {f"C{i}{j}": moduli[i][j] for j in range(first, 6)}
    return named


def _ordered(d: Definition) -> Definition:
    """Return the definition with the fields of the law after those of the host."""
    host_field = re.compile(r"W|s\d|C\d\d|skew\d\d")
    fields = sorted(d.fields, key=lambda field: host_field.fullmatch(field[0]) is None)
    return replace(d, fields=tuple(fields))


def _at_rest(d: Definition) -> Definition:
    """The definition with the six strains at zero: they are no arguments of it."""
    g, zero = d.graph, d.graph.zero
    at_zero: dict[Node, Node] = {g.input("data", k): zero for k in range(6)}
    roots = [d.potential, *(n for _, n in d.fields), *d.constant, *d.interface]
    new, _ = substitute(g, roots, at_zero)
    names, count = [name for name, _ in d.fields], 1 + len(d.fields)
    frozen = new[count : count + len(d.constant)]
    return replace(
        d,
        potential=new[0],
        fields=tuple(zip(names, new[1:count], strict=True)),
        constant=tuple(frozen),
        interface=(),
        data=(),
        tasks=(Task.FIELDS,),
    )


def _close(m: Model, law: Material, P: Sequence[Any], F: Sequence[Any]) -> None:
    """Give the model the potential that every model has; no host asks for its residual."""
    if law.W is not None:
        m.potential(m.integral("stored", law.W))
    else:
        m.weak_form(list(zip(P, F, strict=True)))


def _small(law: Law, m: Model) -> MaterialResponse:
    strains = [m.unknown(f"e{i + 1}{j + 1}") for i, j in VOIGT]
    material = law.on(m, sp.eye(3) + _tensor(strains))
    if material.W is not None:
        stress = m.derivative("s", material.W, strains)
    else:
        stress = [m.define(f"stress_{i}{j}", material.P[i, j]) for i, j in VOIGT]
    moduli = [m.derivative(f"C_{k}", v, strains) for k, v in enumerate(stress)]
    m.fields(**_named(material, stress, moduli))
    if material.P is not None:
        m.fields(**{f"skew{i}{j}": material.P[i, j] - material.P[j, i] for i, j in VOIGT[3:]})
    _close(m, material, stress, strains)
    d = _ordered(m.finish())
    return MaterialResponse(law, Measure.SMALL, _at_rest(d), d, material.W is not None)


def _rounding(d: Definition) -> Any:
    """Difference that symmetric values may have, relative to their size."""
    return mpmath.mpf(10) ** (-12 if functions_of_user(d) else -20)


def checked(r: MaterialResponse, states: Sequence[EvaluationState]) -> MaterialResponse:
    """The response without its test: raises `TargetError` where its stress is not symmetric."""
    d = r.definition
    skew = [n for name, n in d.fields if re.fullmatch(r"skew\d\d", name)]
    stress = [n for _, n in d.fields[1:7]]
    with mpmath.workdps(30):
        for state in states:
            walk = Walk(state, {})
            size = max(abs(walk.at(n, 0)) for n in stress)
            if any(abs(walk.at(n, 0)) > size * _rounding(d) for n in skew):
                raise TargetError(
                    f"the stress of {r.law.name} is not symmetric: its energy must not change "
                    "when the body rotates, write it by F.T * F"
                )
    fields = tuple((name, n) for name, n in d.fields if not re.fullmatch(r"skew\d\d", name))
    return replace(r, definition=replace(d, fields=fields))


def packed(r: MaterialResponse, states: Sequence[EvaluationState]) -> MaterialResponse:
    """The response of a law that gives a stress with 21 moduli: `TargetError` where 36 differ."""
    d = r.definition
    with mpmath.workdps(30):
        for state in states:
            walk = Walk(state, {})
            C = [[walk.at(d.fields[r.modulus(i, j)][1], 0) for j in range(6)] for i in range(6)]
            size = max(abs(c) for row in C for c in row)
            if any(abs(C[i][j] - C[j][i]) > size * _rounding(d) for i, j in _BELOW):
                raise TargetError(
                    f"the modulus of {r.law.name} is not symmetric at a random state: target "
                    "calculix stores 21 moduli; give an energy, m.energy(W), or a state that the "
                    "law can reach, m.example(...)"
                )
    away = {r.modulus(i, j) for i, j in _BELOW}
    fields = tuple(f for k, f in enumerate(d.fields) if k not in away)
    return replace(r, definition=replace(d, fields=fields), symmetric=True)


def point(law: Law) -> Definition:
    """The law as a model of one point: the residual is its stress, the tangent its modulus."""
    small = is_small_strain(law)
    meaning = "Unknowns: strains (shears twice), residual: stress, tangent: modulus."
    if not small:
        meaning = (
            "Unknowns: F row by row, residual: first Piola-Kirchhoff stress P, tangent: dP/dF."
        )
    m = Model(law.name, nodes=1, rule=quadrature.point_rule(), doc=f"{law.doc} {meaning}")
    if small:
        unknowns = [m.unknown(f"e{i + 1}{j + 1}") for i, j in VOIGT]
        F = sp.eye(3) + _tensor(unknowns)
    else:
        unknowns = [m.unknown(f"F{i}{j}") for i in (1, 2, 3) for j in (1, 2, 3)]
        F = sp.Matrix(3, 3, unknowns)
        m.example(F11=1, F22=1, F33=1)
    material = law.on(m, F)
    stress = [material.P[p] for p in VOIGT] if small and material.P is not None else material.P
    P = [] if stress is None else [m.define(f"P_{k}", v) for k, v in enumerate(stress)]
    _close(m, material, P, unknowns)
    return m.finish()


class _Solid(Model):
    """A body of a law, which may use the names of parent coordinates itself."""

    _parent_names = PARENT_NAMES


def solid(law: Law, name: str = "tet4") -> Definition:
    """The law in a standard cell of three dimensions with displacements."""
    kind = cells.element(name)
    m = _Solid(f"{law.name}_{name}", nodes=len(kind.nodes), rule=kind.rule, doc=law.doc)
    X, u = m.coordinates("X", "Y", "Z"), m.nodal_unknowns("u_x", "u_y", "u_z")
    e = kinematics.isoparametric(m, X, kind.gradient(*m.point()), "parent_")
    F = kinematics.deformation_gradient(m, e.dN, u)
    material = law.on(m, F)
    if material.W is not None:
        m.potential(m.integral("Pi", material.W * e.detJ))
    else:
        m.weak_form([(material.P[k] * e.detJ, F[k]) for k in range(9)])
    return m.finish()


def at_one_point(
    write: Callable[[ElementInterface, Sequence[EvaluationState]], Files],
) -> Callable[[Law, StatesOf], Files]:
    """Writer for materials from one for elements: a model of one point, with stress and modulus."""

    def files(law: Law, states: StatesOf) -> Files:
        interface = ElementInterface(point(law))
        return write(interface, states(interface.definition))

    return files
