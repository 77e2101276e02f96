"""Arguments of generated functions: shape and meaning of each pointer.

A family `NAME` has one function for each task, `softehl_NAME_TASK`. All have the same type:

    void f(ptrdiff_t n, ptrdiff_t points, ptrdiff_t modes,
           const double *coordinates, const double *dofs, const double *data,
           const double *parameters, const double *direction,
           const double *rule, const double *basis, double *values, double *tangent);

A call handles `n` elements.  Arrays are contiguous, row-major, of doubles, and do not overlap.
Units are those of the model (mm, MPa, N, s in the shipped ones).

| argument      | shape                | meaning                                                  |
|---------------|----------------------|----------------------------------------------------------|
| `n`           |                      | number of elements                                       |
| `points`      |                      | number of quadrature points                              |
| `modes`       |                      | shape functions of the interpolated field (0 if none)    |
| `coordinates` | n, nodes * ncomp     | reference positions node by node: z1, r1, z2, r2, ...;   |
|               |                      | the components are those of the manifest                 |
| `dofs`        | n, ndof              | direct unknowns in the model's order, then the `modes`   |
|               |                      | unknowns of the interpolated field                       |
| `data`        | n, ndata +           | constants of each element, in the manifest's order; then |
|               | points * npoint      | those of each of its points (history, ...), point by     |
|               |                      | point                                                    |
| `parameters`  | nparameters          | constants of the call, in the manifest's order; then its |
|               |                      | run-time arrays, see below                               |
| `direction`   | n, ndof              | vector that task `product` multiplies by the tangent     |
|               | n, ncoordinates +    | variation of an element that the tasks `pseudo_load` and |
|               | ndata + nparameters  | `fields_rate` follow: of its coordinates, its data (not  |
|               | (+ ndof)             | those of points), the parameters and, in the second, its |
|               |                      | dofs                                                     |
|               | n, the same with     | of the tasks `adjoint_rate` and `point_adjoint_rate`: a  |
|               | dofs, 2 ndof         | variation, then the adjoint of each dof and its rate     |
| `rule`        | points, dimension + 1| parent coordinates of each point, then its weight        |
| `basis`       | points, modes,       | value and xi-derivative of the interpolating shapes, one |
|               | components           | pair for each interpolated field (2 components a field)  |
| `values`      | see task             | written, never accumulated                               |
| `tangent`     | n, ndof, ndof        | written by task `tangent` only, row-major dR_i/du_j      |

| task          | `values`                                                   |
|---------------|------------------------------------------------------------|
| `energy`      | n: the potential (only where the residual has one)         |
| `residual`    | n, ndof: internal minus external virtual work              |
| `tangent`     | n, ndof: the same residual                                 |
| `product`     | n, ndof: tangent times `direction`                         |
| `d_NAME`      | n, ndof: derivative of the residual with respect to the    |
|               | parameter, datum or coordinate NAME                        |
| `pseudo_load` | n, ndof: derivative of the residual along a variation of   |
|               | coordinates, data and parameters, its unknowns held        |
| `fields`      | n, points, nfields: values at the quadrature points        |
| `fields_rate` | n, points, nfields: derivative of the fields along a       |
|               | variation of all that they depend on                       |
| `adjoint_rate`| n, ncoordinates + ndata + nparameters + ndof: rates, along |
|               | a variation, of the derivatives of L by each of these. L is|
|               | the adjoint times the residual, plus the sum over points of|
|               | adjoint times history after the step                       |
| `point_`      | n, points, npoint / 4: the same of the derivatives of L by |
| `adjoint_rate`| the data of points. Their data are those of the page, the  |
|               | rates, the adjoints of the history and the rates of these  |

Run-time arrays (`Definition.arrays`: curves, weights of networks) are the same for all elements of
a call. They stand in `parameters`, behind the constants. First come three numbers for each array:
its position in `parameters`, its length, and the position of its rate (0: it does not vary). Then
come the arrays, and the rates of those that vary. The tasks `pseudo_load` and `fields_rate` read
these rates; their `direction` has no entries for them. The other tasks do not read rates.

History of terms (`Definition.term_history`) has one number for each entry of a run-time array. It
stands in `data`, behind the other data of a point, variable by variable. Where point data have
rates, those of the history of terms follow them. `fields` and `fields_rate` end with the new
values, in the same order.

Pointers that a family does not use (no data, no basis, no parameters, no tangent) may be NULL.
A kernel keeps no state, allocates nothing and reports nothing.  A value outside the domain of the
model is not-a-number.  *All* entries of `values` and `tangent` of an element are not-a-number if a
local iteration (`Model.implicit`) finds no solution, or if a function of stretches gets a matrix
that is not positive definite.  Other elements are not affected.

Targets
-------
`simd` (the default): the functions above.  Each lane of a vector has one element: eight lanes with
AVX-512, else four.  If `n` is no multiple of the lanes, the last elements are computed and written
twice.  A kernel of an interpolated field keeps 8 (ndof + ndof^2) bytes a lane on the stack.  So
does the tangent of a weak form that is compiled as loops around a point, and it also keeps the
moduli of its points.  Such a family contains its rule.  It calls `void softehl_pairs_CELL_DIGEST`,
which computes tangents from moduli; this function has a file of its own, the same for all models
with the same fields.  The lanes are the vector extensions of gcc >= 12 and
clang; another compiler, or `-DSOFTEHL_LANES=1`, gets groups of one element from the same source.
`scalar`: the same text with one lane: one element after another, plain C11.
`ufcx`: one cell at a time for DOLFINx custom kernels.  The tasks `energy`, `residual`, `tangent`,
`d_NAME` and `fields` of a family become functions `softehl_NAME_TASK_ufcx` of UFCx's type,

    void f(double *A, const double *w, const double *c, const double *coordinate_dofs,
           const int *entity_local_index, const uint8_t *quadrature_permutation,
           void *custom_data);

| argument                 | shape              | meaning                                        |
|--------------------------|--------------------|------------------------------------------------|
| `A`                      | 1, ndof, ndof*ndof | **accumulated** (UFCx adds, the caller clears):|
|                          | points * nfields   | energy, residual, tangent row-major, or fields |
|                          |                    | point by point, as an expression               |
| `w`                      | ndof + ndata +     | unknowns of the cell, then its data, then those|
|                          | points * npoint    | of its points, point by point                  |
| `c`                      | nparameters        | parameters, in the manifest's order            |
| `coordinate_dofs`        | nodes, 3           | vertices (x, y, z); the plane ones read (x, y) |
| `entity_local_index`     |                    | not read, may be NULL                          |
| `quadrature_permutation` |                    | not read, may be NULL                          |
| `custom_data`            |                    | not read, may be NULL                          |

Vertices are in the order of DOLFINx (basix), and so are the nodal unknowns in `w` and the rows and
columns of `A`.  `VERTEX_ORDER` maps each node of the model to a node of the Lagrange element of
DOLFINx; a model with other nodes is refused.  A quadrilateral runs around in a model and in
tensor-product order in DOLFINx.  Quadratic elements need a mesh whose geometry is quadratic, too.
The components of one node stay neighbours, as in a blocked element; unknowns that belong to no
node follow.
"""

from __future__ import annotations

from enum import StrEnum

from softehl.errors import SoftehlError


class Task(StrEnum):
    """Task of a kernel of a family."""

    ENERGY = "energy"
    RESIDUAL = "residual"
    TANGENT = "tangent"
    FIELDS = "fields"
    PRODUCT = "product"
    PSEUDO_LOAD = "pseudo_load"
    FIELDS_RATE = "fields_rate"
    ADJOINT_RATE = "adjoint_rate"
    POINT_ADJOINT_RATE = "point_adjoint_rate"


ADJOINT = (Task.ADJOINT_RATE, Task.POINT_ADJOINT_RATE)
"""Tasks of second derivatives of results."""
AT_POINTS = (Task.FIELDS, Task.FIELDS_RATE, Task.POINT_ADJOINT_RATE)
"""Tasks whose values are those of the quadrature points."""
DESIGN = (Task.PSEUDO_LOAD, Task.FIELDS_RATE, *ADJOINT)
"""Tasks of sensitivities, which stand in a file of their own unless they share routines."""
ROLLED = (*AT_POINTS, Task.PSEUDO_LOAD, Task.ADJOINT_RATE)
"""Tasks whose loop over the points is never written out: they are called once a state."""


class TargetError(SoftehlError, ValueError):
    """The model has something that the target cannot hold; the message names it."""


class BuildError(SoftehlError, RuntimeError):
    """The C compiler failed; the message holds the reason, the command line and its output."""


class NoCompilerError(BuildError):
    """There is no C compiler: $CC is not set, none is on the PATH, and there is no ziglang."""


class Target(StrEnum):
    """For whom a kernel is printed."""

    SIMD = "simd"
    SCALAR = "scalar"
    UFCX = "ufcx"


_HEX8 = (0, 1, 3, 2, 4, 5, 7, 6)
VERTEX_ORDER = {
    (1, 0): (0,),
    (2, 0): (0, 1),
    (2, 1): (0, 1),
    (3, 1): (0, 1, 2),
    (3, 2): (0, 1, 2),
    (6, 2): (0, 1, 2, 5, 3, 4),
    (4, 2): (0, 1, 3, 2),
    (9, 2): (0, 1, 3, 2, 4, 6, 7, 5, 8),
    (4, 3): (0, 1, 2, 3),
    (10, 3): (0, 1, 2, 3, 9, 6, 8, 7, 5, 4),
    (6, 3): (0, 1, 2, 3, 4, 5),
    (18, 3): (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16),
    (8, 3): _HEX8,
    (27, 3): (*_HEX8, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 15, 14, 22, 23, 21, 24, 20, 25, 26),
}
"""Node of basix's Lagrange element for each node, by (nodes, parent dimension): all there are.

The nodes are in the order of `elements.cells`. The elements quad8, hex20, wedge15
and pyramid5 have no counterpart: basix knows their functions, but not by values at nodes.
"""


ARRAY_ENTRIES = 3
"""Numbers of a run-time array in front of all arrays: place, length, place of its rate or 0."""


def derivative_task(name: str) -> str:
    """Task that differentiates the residual with respect to a named argument."""
    return f"d_{name}"


PREFIX = "softehl"
VERSION = 1
"""Raised when the meaning of an argument changes: kernels built before are then built anew."""

ARGUMENTS = (
    "ptrdiff_t n, ptrdiff_t points, ptrdiff_t modes,",
    "const double *restrict coordinates, const double *restrict dofs,",
    "const double *restrict data, const double *restrict parameters,",
    "const double *restrict direction,",
    "const double *restrict rule, const double *restrict basis,",
    "double *restrict values, double *restrict tangent",
)


UFCX_ARGUMENTS = (
    "double *restrict A, const double *restrict w, const double *restrict c,",
    "const double *restrict coordinate_dofs, const int *restrict entity_local_index,",
    "const uint8_t *restrict quadrature_permutation, void *custom_data",
)


def function_name(family: str, task: str) -> str:
    """Name of the C function of a family and task."""
    return f"{PREFIX}_{family}_{task}"


def declaration(family: str, task: str) -> str:
    """C prototype without the semicolon."""
    lines = "\n    ".join(ARGUMENTS)
    return f"void {function_name(family, task)}(\n    {lines})"


def ufcx_declaration(family: str, task: str) -> str:
    """C prototype of target `ufcx` without the semicolon."""
    lines = "\n    ".join(UFCX_ARGUMENTS)
    return f"void {function_name(family, task)}_ufcx(\n    {lines})"
