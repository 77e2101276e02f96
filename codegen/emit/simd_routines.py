"""Routines that a kernel calls for several elements at once, as static functions in front of it.

`void f(M active, const V *in, V *out, M *lost)` computes the results for the lanes of `active`;
those in which there is none are not-a-number, and are added to `lost`.
"""

from __future__ import annotations

from collections.abc import Iterable

from softehl.codegen.emit import array_routines, c_routines, tensor_routines, term_loops
from softehl.codegen.emit.c_printer import array_arguments, array_operands, number
from softehl.codegen.emit.simd_printer import LanePrinter
from softehl.codegen.graph.bessel import Bessel
from softehl.codegen.graph.divided_difference import Quotient, SecondQuotient
from softehl.codegen.graph.graph import Routine
from softehl.codegen.graph.routines import External, Inverse, Isotropic, NewtonRoutine
from softehl.codegen.graph.run_time_arrays import ArrayRoutine, Network
from softehl.codegen.graph.tensor_functions import MatrixKernel
from softehl.codegen.graph.term_reductions import Reduction
from softehl.codegen.language.definition import Definition


def texts(d: Definition, routines: Iterable[Routine]) -> list[str]:
    """C functions of the routines and their callees, each once, callees first."""
    return c_routines.texts(d, routines, _text)


def _text(d: Definition, r: Routine) -> list[str]:
    match r:
        case NewtonRoutine():
            return _newton(d, r)
        case Inverse():
            return [_inverse(d, r)]
        case MatrixKernel() if tensor_routines.in_lanes(r):
            unused = c_routines.arrays_unused(d)
            return tensor_routines.text(r, _signature(d, r), unused, tensor_routines.LANES)
        case Isotropic() | External() | Quotient() | SecondQuotient() | MatrixKernel() | Bessel():
            return [*c_routines.texts(d, [r]), _one_by_one(d, r)]
        case Reduction():
            values, targets = term_loops.bodies(r)
            body = c_routines.Body(d, d.graph, values, LanePrinter(d, "active"))
            loop = term_loops.lanes(d, r, _signature(d, r), body.text(2, targets))
            return [*texts(d, body.called), loop]
        case Network():
            return array_routines.lanes(d, r, _signature(d, r))
        case ArrayRoutine():
            return [*c_routines.texts(d, [r]), _one_by_one(d, r)]
    raise TypeError(f"no C for {r}")


def _signature(d: Definition, r: Routine) -> str:
    name = f"softehl_{d.name}_{r.name}_lanes"
    arguments = f"M active, {array_arguments(d)}const V *restrict p, V *restrict s, M *lost"
    return f"static void {name}(\n    {arguments})\n"


def _newton(d: Definition, r: NewtonRoutine) -> list[str]:
    """Lanes that are done keep their solution while others go on."""
    n, first = r.outputs, r.inputs - r.outputs
    values, targets = c_routines.newton_values(r)
    body = c_routines.Body(d, d.graph, values, LanePrinter(d, "active"))
    control, size = r.control, number(float(r.control.size))
    text = f"""/* {r.name}: {n} local unknowns, at most {control.iterations} Newton steps */
{_signature(d, r)}{{
{c_routines.arrays_unused(d)}    const double tolerance = {number(float(control.tolerance))};
    M spoilt = softehl_mask(0);
    V before[{n}];
    for (int k = 0; k < {n}; ++k) s[k] = p[{first} + k], before[k] = softehl_splat(HUGE_VAL);
    for (int step = 0; step < {control.iterations} && softehl_any(active); ++step) {{
        M failed = softehl_mask(0), far = failed;
        V g[{n}], A[{n * n}], B[{max(n * first, 1)}];
{body.text(2, targets)}
        V felt[{n}];
        for (int k = 0; k < {n}; ++k) felt[k] = softehl_splat(0.0);
        for (int i = 0; i < {n}; ++i) {{
            const V terms = softehl_terms_lanes({n}, A + {n} * i, s, {first}, B + {first} * i, p);
            far |= ~softehl_le(softehl_vfabs(g[i]), tolerance * terms);
            for (int k = 0; k < {n}; ++k) {{
                const V share = softehl_vfabs(A[{n} * i + k]) / terms;
                felt[k] = softehl_blend(softehl_lt(felt[k], share), share, felt[k]);
            }}
        }}
        failed |= softehl_eliminate_lanes({n}, A, 1, g);
        spoilt |= active & failed;
        active &= ~failed;
        for (int k = 0; k < {n}; ++k) {{
            s[k] = softehl_blend(active, s[k] - g[k], s[k]);
            const V change = softehl_vfabs(g[k]);
            const V close = tolerance * ({size} + softehl_vfabs(s[k]));
            const M rounding = softehl_lt(0.9 * before[k], change)
                | softehl_le(felt[k] * change, softehl_splat({c_routines.rounding(r)}));
            far |= ~(softehl_le(change, close) | rounding);
            before[k] = change;
        }}
        active &= far;
    }}
    spoilt |= active;
    for (int k = 0; k < {n}; ++k) s[k] = softehl_blend(spoilt, softehl_splat(NAN), s[k]);
    *lost |= spoilt;
}}
"""
    return [*texts(d, body.called), text]


def _inverse(d: Definition, r: Inverse) -> str:
    n = r.size
    return f"""{_signature(d, r)}{{
{c_routines.arrays_unused(d)}    V A[{n * n}];
    for (int k = 0; k < {n * n}; ++k) A[k] = p[k], s[k] = softehl_splat(k % {n + 1} == 0);
    const M spoilt = active & softehl_eliminate_lanes({n}, A, {n}, s);
    for (int k = 0; k < {n * n}; ++k) s[k] = softehl_blend(spoilt, softehl_splat(NAN), s[k]);
    *lost |= spoilt;
}}
"""


def _one_by_one(d: Definition, r: Routine) -> str:
    """A routine of one element called for each lane that wants it."""
    arrays, terms = array_operands(d, "&at"), ""
    if d.term_history:
        terms = """        const softehl_terms at = {
            terms->read ? terms->read + l * terms->read_step : 0, 0,
            terms->write ? terms->write + l * terms->write_step : 0, 0};
        (void)at;
"""
    return f"""{_signature(d, r)}{{
    for (int l = 0; l < SOFTEHL_LANES; ++l) {{
{terms}        double one[{max(r.inputs, 1)}], out[{r.outputs}];
        for (int k = 0; k < {r.inputs}; ++k) one[k] = softehl_lane(p[k], l);
        for (int k = 0; k < {r.outputs}; ++k) out[k] = NAN;
        if (softehl_lane(active, l) && softehl_{d.name}_{r.name}({arrays}one, out))
            softehl_lane(*lost, l) = -1;
        for (int k = 0; k < {r.outputs}; ++k) softehl_lane(s[k], l) = out[k];
    }}
}}
"""
