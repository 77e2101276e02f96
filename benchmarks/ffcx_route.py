"""FFCx: the energy in UFL, differentiated by UFL, two `tabulate_tensor` kernels.

It is an optional package, so it is imported when asked for.  F-bar needs the gradient at another
point than the quadrature point, which a UFL integrand cannot name: there is no route to it.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import re
import shlex
import sysconfig
from typing import Any

from benchmarks.candidate import ENTRY, Candidate, Layout, Stopwatch
from benchmarks.problem import Case

PACKAGE = "fenics-ffcx"
TENSOR = "J, sum factorisation"


def derive(case: Case, route: str) -> Candidate:
    """Two ways to write the energy, and FFCx's one option that changes the arithmetic."""
    ffcx = importlib.import_module("ffcx")
    compiler = importlib.import_module("ffcx.compiler")
    get_options = importlib.import_module("ffcx.options").get_options
    include = importlib.import_module("ffcx.codegeneration").get_include_path()
    tensor = route == TENSOR
    options = get_options({"verbosity": 50, "sum_factorization": tensor})
    element = _element(tensor)
    watch = Stopwatch()
    forms = _forms(case, element, _printed if route == "printed" else _by_J)
    sources, suffixes = compiler.compile_ufl_objects(forms, options=options, namespace="bench")
    seconds = watch.seconds()
    text = dict(zip(suffixes, sources, strict=True))[".c"]
    files = {"kernel.c": f"#include <stddef.h>\n{text}\n{_entry(text, case)}"}
    return Candidate(
        f"FFCx {importlib.metadata.version(PACKAGE)}",
        route,
        case,
        seconds,
        files,
        # geometry is padded to three coordinates: that is the UFCx contract
        Layout(nodes=(0, 3, 1, 2) if tensor else (0, 1, 3, 2), width=3),
        _own_flags(),
        (str(include or ffcx.__path__[0]),),
    )


def _element(tensor: bool) -> Any:
    """Bilinear vector element; as a product of line elements for sum factorisation."""
    basix = importlib.import_module("basix")
    ufl = importlib.import_module("basix.ufl")
    if not tensor:
        return ufl.element("Lagrange", "quadrilateral", 1, shape=(2,))
    kind = (basix.ElementFamily.P, basix.CellType.quadrilateral, 1)
    product = basix.create_tp_element(*kind, basix.LagrangeVariant.gll_warped)
    return ufl.blocked_element(ufl.wrap_element(product), shape=(2,))


def _own_flags() -> tuple[str, ...]:
    """Flags that cffi passes when FFCx compiles just in time: C17 and the flags of this Python."""
    flags = shlex.split(sysconfig.get_config_var("CFLAGS") or "-O2")
    return ("-std=c17", *(f for f in flags if not f.startswith(("-W", "-I"))))


def _forms(case: Case, element: Any, energy: Any) -> list[Any]:
    """Residual, and its derivative when the case asks for the tangent."""
    ufl = importlib.import_module("ufl")
    mesh = ufl.Mesh(element)
    space = ufl.FunctionSpace(mesh, element)
    u, R = ufl.Coefficient(space), ufl.SpatialCoordinate(mesh)[1]
    F, hoop = ufl.Identity(2) + ufl.grad(u), 1 + u[1] / R
    W = energy(ufl, F, hoop, ufl.Constant(mesh, shape=(3,)))
    Pi = W * 2 * ufl.pi * R * ufl.dx(metadata={"quadrature_degree": 3})
    residual = ufl.derivative(Pi, u, ufl.TestFunction(space))
    if not case.tangent:
        return [residual]
    return [residual, ufl.derivative(residual, u, ufl.TrialFunction(space))]


def _printed(ufl: Any, F: Any, hoop: Any, c: Any) -> Any:
    """(3)-(6) as they stand."""
    B, I3 = F * F.T, (ufl.det(F) * hoop) ** 2
    I1 = ufl.tr(B) + hoop**2
    I2 = (I1**2 - ufl.tr(B * B) - hoop**4) / 2
    isochoric = c[0] * (I3 ** (-1 / 3) * I1 - 3) / 2 + c[1] * (I3 ** (-2 / 3) * I2 - 3) / 2
    return isochoric + c[2] * ((I3 - 1) / 2 - ufl.ln(I3) / 2) / 2


def _by_J(ufl: Any, F: Any, hoop: Any, c: Any) -> Any:
    """The energy with fewer and simpler operations: powers of J, in-plane invariants."""
    plane, square = ufl.inner(F, F), hoop**2
    det = ufl.det(F)
    J = det * hoop
    I1, I2 = plane + square, plane * square + det**2
    isochoric = c[0] * (J ** (-2 / 3) * I1 - 3) / 2 + c[1] * (J ** (-4 / 3) * I2 - 3) / 2
    return isochoric + c[2] * ((J**2 - 1) / 2 - ufl.ln(J)) / 2


def _entry(text: str, case: Case) -> str:
    """Loop over the elements; the kernels add, so their output is cleared first."""
    names = re.findall(r"void (tabulate_tensor_\w+)\(", text)
    values, tangent = names[0], names[-1]
    by_rank = {r: n for n, r in zip(names, _ranks(text, names), strict=True)}
    values, tangent = by_rank.get(1, values), by_rank.get(2, tangent)
    lines = ["    (void)tangent;", "    for (ptrdiff_t e = 0; e < n; ++e) {"]
    calls = [("values", 8, values)] + ([("tangent", 64, tangent)] if case.tangent else [])
    for array, size, name in calls:
        at = f"{array} + {size} * e"
        lines.append(f"        memset({at}, 0, {size} * sizeof *{array});")
        lines.append(f"        {name}({at}, u + 8 * e, p, X + 12 * e, 0, 0, 0);")
    return "\n".join([ENTRY, "{", *lines, "    }", "}", ""])


def _ranks(text: str, names: list[str]) -> list[int]:
    """Rank of the form of each kernel: its integral's name is the kernel's without the prefix."""
    ranks = []
    for name in names:
        integral = name.removeprefix("tabulate_tensor_")
        form = re.search(rf"form_integrals_(form_\w+)\[\d+\] = \{{&{integral}", text)
        rank = form and re.search(rf"ufcx_form {form[1]} =\s*\{{.*?\.rank = (\d)", text, re.S)
        if not rank:
            raise RuntimeError(f"FFCx wrote a file in which {integral} belongs to no form")
        ranks.append(int(rank[1]))
    return ranks
