"""C of reductions over terms: one loop, several elements at once."""

from __future__ import annotations

from collections.abc import Iterator

from softehl.codegen.emit.c_printer import length_place, terms_expression
from softehl.codegen.graph.graph import InputEntry, Node
from softehl.codegen.graph.term_reductions import Entry, Kind, Reduction, splits
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition


def bodies(r: Reduction) -> tuple[list[Node], list[str]]:
    """Values of a term that a loop needs, and the variables that take them."""
    values = [r.slope(r.graph, e) for e in r.needed()]
    return values, [f"f[{k}]" for k in range(len(values))]


def single(d: Definition, r: Reduction, signature: str, body: str) -> str:
    """C function of a reduction for one element; body: statements of `bodies`."""
    loads, local = _locals(r, lanes=False)
    return f"""{_banner(r)}{signature.replace("double *restrict s)", "double *restrict o)")}{{
    int failed = 0;
{_arrays(d, r)}    double t[{len(r.needed())}] = {{{_start(r, "{}")}}};
    for (ptrdiff_t i = 0; i < n; ++i) {{
{loads}        const double s[] = {{{local}}};
        double f[{len(r.needed())}];
        (void)s, (void)p;
{body}
{"".join(f"        {line}{chr(10)}" for line in _update(d, r, lanes=False))}    }}
{"".join(f"    {line}{chr(10)}" for line in _results(r))}    return failed;
}}
"""


def lanes(d: Definition, r: Reduction, signature: str, body: str) -> str:
    """C function of a reduction for several elements at once; body: statements of `bodies`."""
    loads, local = _locals(r, lanes=True)
    return f"""{_banner(r)}{signature.replace("V *restrict s,", "V *restrict o,")}{{
    M failed = softehl_mask(0);
{_arrays(d, r)}    V t[{len(r.needed())}] = {{{_start(r, "softehl_splat({})")}}};
    for (ptrdiff_t i = 0; i < n; ++i) {{
{loads}        const V s[] = {{{local}}};
        V f[{len(r.needed())}];
        (void)s, (void)p;
{body}
{"".join(f"        {line}{chr(10)}" for line in _update(d, r, lanes=True))}    }}
{"".join(f"    {line}{chr(10)}" for line in _results(r))}    *lost |= active & failed;
}}
"""


def _banner(r: Reduction) -> str:
    return f"/* {r.name}: {r.kind} over terms */\n"


def _arrays(d: Definition, r: Reduction) -> str:
    """The number of terms n, the entries a0, a1, ... of arrays, and their rates r0, r1, ..."""
    lines = []
    for k, array in enumerate(r.arrays):
        if array < 0:
            read = f"terms->read + {_history_offset(d, -1 - array)}"
            index = length_place(d, d.term_history[-1 - array].array)
            rates = f"a{k} + {len(d.point_data) // 2} + {terms_expression(d)}"
            rates = rates if d.point_rates else "parameters"
        else:
            index = length_place(d, array)
            read = f"parameters + (ptrdiff_t)parameters[{index - 1}]"
            rates = f"parameters + (ptrdiff_t)parameters[{index + 1}]"
        lines += [f"const double *const a{k} = {read};", f"const double *const r{k} = {rates};"]
        lines.append(f"(void)a{k}, (void)r{k};")
        count = f"(ptrdiff_t)parameters[{index}]"
        lines.append(f"ptrdiff_t n = {count};" if k == 0 else f"if ({count} < n) n = {count};")
    if d.term_history:
        lines.append("(void)terms;")
    return "".join(f"    {line}\n" for line in lines)


def _history_offset(d: Definition, history: int) -> str:
    """Numbers of a point before those of a history of terms."""
    lengths = [f"(ptrdiff_t)parameters[{length_place(d, h.array)}]" for h in d.term_history]
    return " + ".join(["0", *lengths[:history]])


def _locals(r: Reduction, *, lanes: bool) -> tuple[str, str]:
    """Statements, and the entries of the arrays and rates of a term."""
    count, loads, names = len(r.arrays), list[str](), list[str]()
    used = {
        n.payload.index
        for n in reachable(bodies(r)[0])
        if isinstance(n.payload, InputEntry) and n.payload.array == "local"
    }
    for k in range(2 * count):
        letter, number = "ar"[k // count], k % count
        entry = f"{letter}{number}[i]"
        if k not in used:
            names.append("softehl_splat(0.0)" if lanes else "0.0")
        elif r.arrays[number] >= 0:
            value = entry if letter == "a" else f"r{number} == parameters ? 0.0 : {entry}"
            names.append(f"softehl_splat({value})" if lanes else value)
        elif lanes:
            loads += [
                f"V h{k};",
                f"softehl_load1({letter}{number} + i, terms->read_step, &h{k});",
            ]
            names.append(f"h{k}")
        else:
            names.append(entry)
    return "".join(f"        {line}\n" for line in loads), ", ".join(names)


_EMPTY = {
    **{Kind.SUM: "0.0", Kind.PRODUCT: "1.0", Kind.EACH: "0.0"},
    **{Kind.MINIMUM: "HUGE_VAL", Kind.MAXIMUM: "-HUGE_VAL"},
}


def _start(r: Reduction, splat: str) -> str:
    return ", ".join(splat.format("0.0" if by else _EMPTY[r.kind]) for _, by in r.needed())


def _update(d: Definition, r: Reduction, *, lanes: bool) -> Iterator[str]:
    """Statements that join a term f to what is known, t."""
    needed = r.needed()
    index_of = {e: k for k, e in enumerate(needed)}
    if r.kind is Kind.EACH:
        for (k, _), e in index_of.items():
            at = f"terms->write + {_history_offset(d, r.targets[k])} + i"
            store = f"softehl_store1({at}, terms->write_step, f[{e}]);"
            yield store if lanes else f"*({at}) = f[{e}];"
    elif r.kind is Kind.SUM:
        yield from (f"t[{k}] += f[{k}];" for k in index_of.values())
    elif r.kind is Kind.PRODUCT:
        for entry in reversed(needed):
            products = (f"t[{index_of[a]}] * f[{index_of[b]}]" for a, b in splits(entry))
            yield f"t[{index_of[entry]}] = {' + '.join(products)};"
    else:
        yield from _selection(r, index_of, lanes=lanes)


def _selection(r: Reduction, index_of: dict[Entry, int], *, lanes: bool) -> Iterator[str]:
    """The better term with its derivatives; not-a-number stays."""
    for k in dict.fromkeys(k for k, _ in index_of):
        at = index_of[k, ()]
        pair = (f"t[{at}]", f"f[{at}]") if r.kind is Kind.MINIMUM else (f"f[{at}]", f"t[{at}]")
        if lanes:
            mask = f"softehl_le({pair[0]}, {pair[1]})"
            yield f"const M b{k} = ~{mask} & softehl_eq(t[{at}], t[{at}]);"
        else:
            yield f"const int b{k} = !({pair[0]} <= {pair[1]}) && t[{at}] == t[{at}];"
        for entry, e in index_of.items():
            if entry[0] == k:
                value = (
                    f"softehl_blend(b{k}, f[{e}], t[{e}])" if lanes else f"b{k} ? f[{e}] : t[{e}]"
                )
                yield f"t[{e}] = {value};"


def _results(r: Reduction) -> Iterator[str]:
    index_of = {e: k for k, e in enumerate(r.needed())}
    yield from (f"o[{k}] = t[{index_of[e]}];" for k, e in enumerate(r.entries))
