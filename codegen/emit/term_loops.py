"""C of reductions over terms: one loop, several elements at once."""

from __future__ import annotations

from collections.abc import Iterator

from softehl.codegen.abi import ARRAY_ENTRIES
from softehl.codegen.graph.graph import Node
from softehl.codegen.graph.term_reductions import Entry, Kind, Reduction, splits
from softehl.codegen.language.definition import Definition


def bodies(r: Reduction) -> tuple[list[Node], list[str]]:
    """Values of a term that a loop needs, and the variables that take them."""
    values = [r.slope(r.graph, e) for e in r.needed()]
    return values, [f"f[{k}]" for k in range(len(values))]


def single(d: Definition, r: Reduction, signature: str, body: str) -> str:
    """C function of a reduction for one element; body: statements of `bodies`."""
    return f"""{_banner(r)}{signature.replace("double *restrict s)", "double *restrict o)")}{{
    int failed = 0;
{_arrays(d, r)}    double t[{len(r.needed())}] = {{{_start(r, "{}")}}};
    for (ptrdiff_t i = 0; i < n; ++i) {{
        const double s[] = {{{_locals(r, "{}")}}};
        double f[{len(r.needed())}];
        (void)s, (void)p;
{body}
{"".join(f"        {line}{chr(10)}" for line in _update(r, lanes=False))}    }}
{"".join(f"    {line}{chr(10)}" for line in _results(r))}    return failed;
}}
"""


def lanes(d: Definition, r: Reduction, signature: str, body: str) -> str:
    """C function of a reduction for several elements at once; body: statements of `bodies`."""
    return f"""{_banner(r)}{signature.replace("V *restrict s,", "V *restrict o,")}{{
    M failed = softehl_mask(0);
{_arrays(d, r)}    V t[{len(r.needed())}] = {{{_start(r, "softehl_splat({})")}}};
    for (ptrdiff_t i = 0; i < n; ++i) {{
        const V s[] = {{{_locals(r, "softehl_splat({})")}}};
        V f[{len(r.needed())}];
        (void)s, (void)p;
{body}
{"".join(f"        {line}{chr(10)}" for line in _update(r, lanes=True))}    }}
{"".join(f"    {line}{chr(10)}" for line in _results(r))}    *lost |= active & failed;
}}
"""


def _banner(r: Reduction) -> str:
    return f"/* {r.name}: {r.kind} over terms */\n"


def _arrays(d: Definition, r: Reduction) -> str:
    """The number of terms n, the entries a0, a1, ... of arrays, and their rates r0, r1, ..."""
    lines = []
    for k, array in enumerate(r.arrays):
        at = len(d.parameters) + ARRAY_ENTRIES * array
        place = f"const double *const {{}}{k} = parameters + (ptrdiff_t)parameters[{{}}];"
        lines += [place.format("a", at), place.format("r", at + 2), f"(void)r{k};"]
        count = f"(ptrdiff_t)parameters[{at + 1}]"
        lines.append(f"ptrdiff_t n = {count};" if k == 0 else f"if ({count} < n) n = {count};")
    return "".join(f"    {line}\n" for line in lines)


def _locals(r: Reduction, splat: str) -> str:
    """Entries of the arrays and rates of a term."""
    count = len(r.arrays)
    used = any(i >= r.inputs - count for _, by in r.entries for i in by)
    entries = [splat.format(f"a{k}[i]") for k in range(count)]
    moving = "r{} == parameters ? 0.0 : r{}[i]" if used else "0.0"
    return ", ".join([*entries, *(splat.format(moving.format(k, k)) for k in range(count))])


_EMPTY = {Kind.SUM: "0.0", Kind.PRODUCT: "1.0", Kind.MINIMUM: "HUGE_VAL", Kind.MAXIMUM: "-HUGE_VAL"}


def _start(r: Reduction, splat: str) -> str:
    return ", ".join(splat.format("0.0" if by else _EMPTY[r.kind]) for _, by in r.needed())


def _update(r: Reduction, *, lanes: bool) -> Iterator[str]:
    """Statements that join a term f to what is known, t."""
    needed = r.needed()
    place = {e: k for k, e in enumerate(needed)}
    if r.kind is Kind.SUM:
        yield from (f"t[{k}] += f[{k}];" for k in place.values())
    elif r.kind is Kind.PRODUCT:
        for entry in reversed(needed):
            products = (f"t[{place[a]}] * f[{place[b]}]" for a, b in splits(entry))
            yield f"t[{place[entry]}] = {' + '.join(products)};"
    else:
        yield from _selection(r, place, lanes=lanes)


def _selection(r: Reduction, place: dict[Entry, int], *, lanes: bool) -> Iterator[str]:
    """The better term with its derivatives; not-a-number stays."""
    for k in dict.fromkeys(k for k, _ in place):
        at = place[k, ()]
        pair = (f"t[{at}]", f"f[{at}]") if r.kind is Kind.MINIMUM else (f"f[{at}]", f"t[{at}]")
        if lanes:
            kept = f"softehl_le({pair[0]}, {pair[1]})"
            yield f"const M b{k} = ~{kept} & softehl_eq(t[{at}], t[{at}]);"
        else:
            yield f"const int b{k} = !({pair[0]} <= {pair[1]}) && t[{at}] == t[{at}];"
        for entry, e in place.items():
            if entry[0] == k:
                value = (
                    f"softehl_blend(b{k}, f[{e}], t[{e}])" if lanes else f"b{k} ? f[{e}] : t[{e}]"
                )
                yield f"t[{e}] = {value};"


def _results(r: Reduction) -> Iterator[str]:
    place = {e: k for k, e in enumerate(r.needed())}
    yield from (f"o[{k}] = t[{place[e]}];" for k, e in enumerate(r.entries))
