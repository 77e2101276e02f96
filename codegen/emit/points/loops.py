"""The loops of a cell around the function of a point: interpolation, fluxes to nodes, stores."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from softehl.codegen import abi
from softehl.codegen.abi import Task
from softehl.codegen.emit import simd
from softehl.codegen.emit.points import function, pairs
from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.layout import Layout, Needs, orders
from softehl.codegen.emit.points.lines import Lines, load, store
from softehl.codegen.emit.printer import design_width
from softehl.codegen.language.definition import Component, Quantity

Rows = tuple[int, ...]


class Group:
    """The function that handles one group of elements in a task."""

    def __init__(self, layout: Layout, task: str, outputs: Outputs, pairs: str = "") -> None:
        """pairs: name of the function that makes tangents of moduli."""
        self.layout, self.pairs = layout, pairs
        self.task, self.outputs = task, outputs
        self.needs = Needs.of(outputs.entries)
        self.out = Lines()
        self.D = layout.dimension
        self.widths = simd.widths(layout.d, task)
        self.ring = layout.form.axisymmetric
        self.design = task in abi.DESIGN
        self.spread = function.used(task)
        self.first_dof = design_width(layout.d)

    # the whole ----------------------------------------------------------------------------------

    def text(self) -> str:
        """C text of the group function."""
        self._start()
        self.out.open(f"for (int q = 0; q < {self.layout.points}; ++q)")
        self._geometry()
        self._inputs()
        self._call()
        self.out.close()
        if self.task == Task.TANGENT:
            self.out.add(f"{self.pairs}(S, K);")
        self._finish()
        name = abi.function_name(self.layout.d.name, self.task)
        idle = ", ".join(f"(void){n}" for _, n in simd.GROUP)
        arguments = ",\n    ".join(f"{kind} {n}".replace("* ", "*") for kind, n in simd.GROUP)
        body = "\n".join(self.out.lines)
        return f"static void {name}_group(\n    {arguments})\n{{\n    {idle};\n{body}\n}}\n"

    def _start(self) -> None:
        out, d = self.out, self.layout.d
        arrays = {
            "xs": ("X", d.coordinate_width, self.widths["coordinates"]),
            "us": ("d", len(d.unknowns), self.widths["dofs"]),
            "es": ("a", len(d.data), self.widths["data"]),
            "ts": ("t", self._moving(), self.widths["direction"]),
        }
        for array, (source, count, width) in arrays.items():
            if count:
                out.add(f"V {array}[{count}];")
                load(out, array, source, count, width)
                out.add(f"(void){array};")
        out.add("M failed = softehl_mask(0);")
        if self.spread:
            out.add(f"V r[{len(d.unknowns)}];")
            out.add(f"for (int k = 0; k < {len(d.unknowns)}; ++k) r[k] = softehl_splat(0.0);")
        if self.task == Task.ENERGY:
            out.add("V r[1] = {softehl_splat(0.0)};")
        if self.task == Task.TANGENT:
            size = pairs.Parent(self.layout, self.outputs).size
            out.add(f"V S[{self.layout.points}][{size}];")

    def _moving(self) -> int:
        """Entries of `direction` of an element."""
        d = self.layout.d
        sizes = {
            Task.PRODUCT: len(d.unknowns),
            Task.PSEUDO_LOAD: self.first_dof,
            Task.FIELDS_RATE: self.first_dof + len(d.unknowns),
        }
        return sizes.get(Task(self.task), 0) if self.task in set(Task) else 0

    # geometry -----------------------------------------------------------------------------------

    def _geometry(self) -> None:
        """Jacobian, its inverse I (parent by reference coordinate), place, volume."""
        out, D = self.out, self.D
        sums = {f"J{i}{k}": (f"xs[{D} * n + {i}]", f"D{k}") for i in range(D) for k in range(D)}
        if self._placed():
            sums |= {f"X{i}": (f"xs[{D} * n + {i}]", "N") for i in range(D)}
        if self.design:
            sums |= {
                f"dJ{i}{k}": (f"ts[{D} * n + {i}]", f"D{k}") for i in range(D) for k in range(D)
            }
            sums |= {f"dX{i}": (f"ts[{D} * n + {i}]", "N") for i in range(D)}
        self._sums(self.layout.geometry.order, sums)
        self._inverse()
        if self.design:
            self._moved_geometry()
        if self.spread or self.task == Task.ENERGY:
            ring = " * (6.283185307179586 * X1)" if self.ring else ""
            out.add(f"const V w = det * {self.layout.d.cell}_W[q]{ring};")

    def _placed(self) -> bool:
        return bool(self.needs["coordinates"]) or self.ring

    def _sums(self, order: int, sums: dict[str, tuple[str, str]]) -> None:
        """Sums over the nodes of an order: name -> value at the node n, factor N, D0, D1 or D2."""
        if not sums:
            return
        out = self.out
        nodes = self.layout.shape(order).nodes
        out.add(f"V {', '.join(f'{k} = softehl_splat(0.0)' for k in sums)};")
        out.open(f"for (int n = 0; n < {nodes}; ++n)")
        self._factors(order, {f for _, f in sums.values()}, "n")
        values = dict.fromkeys(v for v, _ in sums.values())
        named = {v: f"value{k}" for k, v in enumerate(values)}
        for v, k in named.items():
            out.add(f"const V {k} = {v};")
        for k, (v, f) in sums.items():
            out.add(f"{k} += {named[v]} * {f};")
        out.close()

    def _factors(self, order: int, wanted: Iterable[str], node: str) -> None:
        name = self.layout.d.cell
        for f in sorted(wanted):
            entry = "" if f == "N" else f"[{f[1:]}]"
            table = "N" if f == "N" else "D"
            self.out.add(f"const double {f} = {name}_{table}{order}[q][{node}]{entry};")

    def _inverse(self) -> None:
        out = self.out
        if self.D == 1:
            out.add("const V det = J00, I00 = 1.0 / det;")
        elif self.D == 2:
            out.add("const V det = J00 * J11 - J01 * J10, one = 1.0 / det;")
            out.add("const V I00 = J11 * one, I01 = -J01 * one, I10 = -J10 * one, I11 = J00 * one;")
        else:
            for k in range(3):
                a, b = (k + 1) % 3, (k + 2) % 3
                for i in range(3):
                    c, e = (i + 1) % 3, (i + 2) % 3
                    out.add(f"const V C{i}{k} = J{c}{a} * J{e}{b} - J{c}{b} * J{e}{a};")
            out.add("const V det = J00 * C00 + J10 * C10 + J20 * C20, one = 1.0 / det;")
            for k in range(3):
                out.add(f"const V {', '.join(f'I{k}{i} = C{i}{k} * one' for i in range(3))};")

    def _moved_geometry(self) -> None:
        """Slopes L of the variation of places, and the relative change of volume."""
        out, D = self.out, self.D
        for i in range(D):
            for j in range(D):
                total = " + ".join(f"dJ{i}{k} * I{k}{j}" for k in range(D))
                out.add(f"const V L{i}{j} = {total};")
        ring = " + dX1 / X1" if self.ring else ""
        out.add(f"const V swell = {' + '.join(f'L{i}{i}' for i in range(D))}{ring};")
        out.add("(void)swell;")
        out.add(" ".join(f"(void)dX{i};" for i in range(D)))

    # what the function of the point reads -------------------------------------------------------

    def _inputs(self) -> None:
        """The arrays x, g, e, b, t of the function of the point."""
        site, form = self.layout.site, self.layout.form
        known = self._interpolated("us", {k: form.all[k] for k in self._read("dofs")}, "g")
        data = {k: form.data[k] for k in self._read("data") if k in form.data}
        known |= self._interpolated("es", data, "e")
        names = [a.name for a in self.layout.d.data]
        for k in self._read("data"):
            if k not in form.data:
                known[f"e[{k}]"] = f"es[{names.index(site.data[k].name)}]"
        known |= {f"x[{k}]": f"X{k}" for k in self._read("coordinates")}
        self._array("x", self.D, known)
        self._array("g", len(form.all), known)
        self._array("e", len(site.data), known)
        self._point_data()
        moved = self._direction(known)
        width = 1 + max([*self.needs["direction"], 0])
        self._array("t", width, moved)

    def _read(self, array: str) -> Rows:
        """Entries that the function reads; in tasks of variations also those that move."""
        found = set(self.needs[array])
        if self.design:
            site, form = self.layout.site, self.layout.form
            first = len(site.coordinates) + len(site.data) + len(site.parameters)
            for k in self.needs["direction"]:
                if array == "dofs" and k >= first:
                    found.update(self._with_slopes(form.all, k - first))
                if array == "data" and 0 <= k - self.D < len(site.data):
                    n = k - self.D
                    if n in form.data:
                        some = [
                            m for m, q in form.data.items() if q.component == form.data[n].component
                        ]
                        found.update(some if form.data[n].axis is not None else [n])
        return tuple(sorted(found))

    def _with_slopes(self, quantities: Sequence[Quantity], k: int) -> list[int]:
        """A slope with the other slopes of its component, on which its variation depends."""
        q = quantities[k]
        if q.axis is None:
            return [k]
        return [
            m for m, o in enumerate(quantities) if o.component == q.component and o.axis is not None
        ]

    def _interpolated(self, source: str, wanted: dict[int, Quantity], array: str) -> dict[str, str]:
        """Values and slopes of components at the point: entry of an array -> expression.

        source: the array of the element.
        """
        found: dict[str, str] = {}
        mark = {"us": "u", "es": "e", "ts": "t"}[source]
        for order in orders(list(wanted.values())):
            sums: dict[str, tuple[str, str]] = {}
            here = {k: q for k, q in wanted.items() if q.component.order == order}
            label = {c: f"{mark}{order}{n}" for n, c in enumerate(_components(here.values()))}
            for q in here.values():
                at = f"{source}[{self._place(q.component, source)}]"
                if q.axis is None:
                    sums[f"{label[q.component]}_v"] = (at, "N")
                else:
                    sums |= {f"{label[q.component]}_{k}": (at, f"D{k}") for k in range(self.D)}
            self._sums(order, sums)
            for k, q in here.items():
                c = label[q.component]
                slope = " + ".join(f"{c}_{m} * I{m}{q.axis}" for m in range(self.D))
                found[f"{array}[{k}]"] = f"{c}_v" if q.axis is None else slope
        return found

    def _place(self, c: Component, source: str) -> str:
        place = self.layout.place(c)
        if source == "ts":
            first = 0 if self.task == Task.PRODUCT else self.first_dof
            if c.given:
                first = self.layout.d.coordinate_width
            return f"{first} + {place.at('n')}"
        return place.at("n")

    def _array(self, name: str, size: int, values: dict[str, str]) -> None:
        """Declare an argument of the function of the point and fill what it reads."""
        mine = {k: v for k, v in values.items() if k.startswith(f"{name}[")}
        self.out.add(f"V {name}[{max(size, 1)}];")
        for entry, value in mine.items():
            self.out.add(f"{entry} = {value};")

    def _point_data(self) -> None:
        d = self.layout.d
        count = len(d.point_data)
        self.out.add(f"V b[{max(count, 1)}];")
        if count:
            load(
                self.out,
                "b",
                f"a + {len(d.data)} + {count} * q",
                count,
                f"({len(d.data)} + {count * self.layout.points})",
            )

    def _direction(self, known: dict[str, str]) -> dict[str, str]:
        """The argument t: how what the function reads moves."""
        form, site = self.layout.form, self.layout.site
        wanted = self.needs["direction"]
        if self.task == Task.PRODUCT:
            return self._interpolated("ts", {k: form.all[k] for k in wanted}, "t")
        if not self.design:
            return {}
        first = self.D + len(site.data) + len(site.parameters)
        moved: dict[str, str] = {}
        if self.task == Task.FIELDS_RATE:
            some = {k: form.all[k - first] for k in wanted if k >= first}
            moved |= self._interpolated("ts", some, "t")
        data = {k: form.data[k - self.D] for k in wanted if k - self.D in form.data}
        moved |= self._interpolated("ts", data, "t")
        names, width = [a.name for a in self.layout.d.data], self.layout.d.coordinate_width
        for k in wanted:
            entry = f"t[{k}]"
            if k < self.D:
                moved[entry] = f"dX{k}"
            elif k < self.D + len(site.data):
                if k - self.D in form.data:
                    moved[entry] += self._drag(form.data, k - self.D, "e")
                else:
                    moved[entry] = f"ts[{width + names.index(site.data[k - self.D].name)}]"
            elif k < first:
                moved[entry] = f"ts[{width + len(names) + k - self.D - len(site.data)}]"
            else:
                quantities = dict(enumerate(form.all))
                start = moved.get(entry, "softehl_splat(0.0)")
                moved[entry] = start + self._drag(quantities, k - first, "g")
        return moved

    def _drag(self, quantities: Mapping[int, Quantity], k: int, array: str) -> str:
        """What a slope loses because the places move: - (slopes) L."""
        q = quantities[k]
        if q.axis is None:
            return ""
        others = {o.axis: m for m, o in quantities.items() if o.component == q.component}
        return "".join(f" - {array}[{others[m]}] * L{m}{q.axis}" for m in range(self.D))

    # what it gives ------------------------------------------------------------------------------

    def _call(self) -> None:
        out, outputs, d = self.out, self.outputs, self.layout.d
        out.add(f"V P[{max(len(outputs.rows), 1)}];")
        out.add(f"V A[{max(len(outputs.moduli), len(outputs.rates), 1)}];")
        call = function.name(self.layout, self.task)
        out.add(f"failed |= {call}(parameters, x, g, e, b, t, P, A);")
        if self.task == Task.ENERGY:
            out.add("r[0] += w * P[0];")
        elif self.task in abi.AT_POINTS:
            width = f"({len(d.fields)} * {self.layout.points})"
            store(out, f"R + {len(d.fields)} * q", "P", len(d.fields), width)
        else:
            moved = self.task == Task.PSEUDO_LOAD
            self._fluxes(self._moved_fluxes() if moved else self._plain_fluxes())
        if self.task == Task.TANGENT:
            pairs.pulled_back(out, self.layout, outputs)

    def _plain_fluxes(self) -> dict[Quantity, str]:
        return {q: f"P[{k}]" for k, q in enumerate(self.layout.form.unknowns)}

    def _moved_fluxes(self) -> dict[Quantity, str]:
        """Rates of fluxes with what the moving places add."""
        numbers = {q: k for k, q in enumerate(self.layout.form.unknowns)}
        found: dict[Quantity, str] = {}
        for c in _components(numbers):
            mine = {q.axis: k for q, k in numbers.items() if q.component == c}
            slopes = {axis: k for axis, k in mine.items() if axis is not None}
            for axis in [*([None] if None in mine else []), *(range(self.D) if slopes else [])]:
                terms = []
                if axis in mine:
                    terms.append(f"A[{mine[axis]}] + swell * P[{mine[axis]}]")
                if axis is not None:
                    terms += [f"(-P[{k}]) * L{axis}{m}" for m, k in slopes.items()]
                name = f"moved{len(found)}"
                self.out.add(f"const V {name} = {' + '.join(terms)};")
                found[Quantity(c, axis)] = name
        return found

    def _fluxes(self, fluxes: dict[Quantity, str]) -> None:
        """Fluxes pulled back to the parent cell and added at the nodes."""
        out = self.out
        for order in orders(list(fluxes)):
            here = {q: v for q, v in fluxes.items() if q.component.order == order}
            terms: dict[Component, list[str]] = {}
            for n, c in enumerate(_components(here)):
                slopes = {q.axis: v for q, v in here.items() if q.component == c}
                value = slopes.pop(None, None)
                terms[c] = []
                if value is not None:
                    out.add(f"const V f{order}{n} = w * {value};")
                    terms[c].append(f"f{order}{n} * N")
                for m in range(self.D if slopes else 0):
                    total = " + ".join(f"{v} * I{m}{axis}" for axis, v in slopes.items())
                    out.add(f"const V f{order}{n}{m} = w * ({total});")
                    terms[c].append(f"f{order}{n}{m} * D{m}")
            out.open(f"for (int n = 0; n < {self.layout.shape(order).nodes}; ++n)")
            factors = {t.rpartition(" ")[2] for some in terms.values() for t in some}
            self._factors(order, factors, "n")
            for c, some in terms.items():
                out.add(f"r[{self.layout.place(c).at('n')}] += {' + '.join(some)};")
            out.close()

    def _finish(self) -> None:
        out, d = self.out, self.layout.d
        size = len(d.unknowns)
        if self.spread or self.task == Task.ENERGY:
            count = size if self.spread else 1
            store(out, "R", "r", count, str(count))
        out.open("if (softehl_any(failed))")
        out.add(f"softehl_spoil(failed, R, {self.widths['values']});")
        if self.task == Task.TANGENT:
            out.add(f"softehl_spoil(failed, K, {size * size});")
        out.close()


def _components(quantities: Iterable[Quantity]) -> list[Component]:
    return list(dict.fromkeys(q.component for q in quantities))
