"""Neo-Hooke in FFCx, for `benchmarks.solids`: `python ffcx_solid.py CELL FOLDER`.

Run where FFCx is. It writes `forms.c`, residual and tangent as `tabulate_tensor` functions, and
`told.json`: version, where the headers are, seconds, and places of the nodes in their order.
"""

import importlib.metadata
import json
import sys
import time
from pathlib import Path

import basix
import basix.ufl
import ffcx
import ffcx.codegeneration
import ffcx.compiler
import ffcx.options
import ufl

CELLS = {
    "quad4": ("quadrilateral", 1),
    "quad9": ("quadrilateral", 2),
    "hex8": ("hexahedron", 1),
    "hex27": ("hexahedron", 2),
    "tet4": ("tetrahedron", 1),
    "tet10": ("tetrahedron", 2),
}


def main(cell, folder, degree):
    """degree: of the quadrature, which must have as many points as ours."""
    kind, order = CELLS[cell]
    size = 2 if kind == "quadrilateral" else 3
    element = basix.ufl.element("Lagrange", kind, order, shape=(size,))
    mesh = ufl.Mesh(element)
    space = ufl.FunctionSpace(mesh, element)
    u, c = ufl.Coefficient(space), ufl.Constant(mesh, shape=(2,))
    start = time.process_time()
    F = ufl.Identity(size) + ufl.grad(u)
    J, traced = ufl.det(F), ufl.inner(F, F) + 3 - size
    W = c[0] / 2 * (traced - 3 - 2 * ufl.ln(J)) + c[1] / 2 * (J - 1) ** 2
    residual = ufl.derivative(
        W * ufl.dx(metadata={"quadrature_degree": degree}), u, ufl.TestFunction(space)
    )
    tangent = ufl.derivative(residual, u, ufl.TrialFunction(space))
    options = ffcx.options.get_options({"verbosity": 50})
    texts, suffixes = ffcx.compiler.compile_ufl_objects(
        [residual, tangent], options=options, namespace="bench"
    )
    seconds = time.process_time() - start
    (folder / "forms.c").write_text(dict(zip(suffixes, texts, strict=True))[".c"])
    told = {
        "version": importlib.metadata.version("fenics-ffcx"),
        "include": str(ffcx.codegeneration.get_include_path() or ffcx.__path__[0]),
        "seconds": seconds,
        "nodes": basix.create_element(
            basix.ElementFamily.P, basix.CellType[kind], order, basix.LagrangeVariant.gll_warped
        ).points.tolist(),
    }
    (folder / "told.json").write_text(json.dumps(told))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
