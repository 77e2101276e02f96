"""Inputs of the function of a point: fields, gradients, data, history, and their variations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from softehl.codegen.abi import AT_POINTS, Task
from softehl.codegen.emit.c_printer import (
    fields_expression,
    point_expression,
    terms_expression,
)
from softehl.codegen.emit.points.c_lines import load
from softehl.codegen.emit.points.loop_nest import Frame, components
from softehl.codegen.emit.points.point_layout import orders
from softehl.codegen.language.definition import Component, PointQuantity


@dataclass(frozen=True, eq=False)
class PointInputs:
    """The arguments of the function of a point, as lines of the frame `f`."""

    f: Frame

    def write(self, *, direction: bool = True) -> None:
        """The arrays x, g, e, b, t of the function of the point; without direction not t."""
        site, form = self.f.layout.site, self.f.layout.form
        values = self._interpolated("us", self._fields(self._read("dofs")), "g")
        values |= self._centroid("g", "c", 0, self._read("dofs"))
        data = {k: form.data[k] for k in self._read("data") if k in form.data}
        values |= self._interpolated("es", data, "e")
        names = [a.name for a in self.f.layout.d.data]
        for k in self._read("data"):
            if k not in form.data:
                values[f"e[{k}]"] = f"es[{names.index(site.data[k].name)}]"
        values |= {f"x[{k}]": f"X{k}" for k in self._read("coordinates")}
        self._array("x", self.f.D, values)
        self._array("g", len(form.all), values)
        self._array("e", len(site.data), values)
        self._point_data()
        if not direction:
            return
        moved = self._direction(values)
        width = 1 + max([*self.f.needs["direction"], 0])
        self._array("t", width, moved)

    def _fields(self, numbers: Iterable[int]) -> dict[int, PointQuantity]:
        """Unknowns by number, those at the centroid left out."""
        form = self.f.layout.form
        return {k: form.all[k] for k in numbers if k not in form.centroid}

    def _centroid(
        self, to: str, source: str, first: int, numbers_read: Sequence[int]
    ) -> dict[str, str]:
        """Entries of an array that are values at the centroid, or their rates."""
        numbers = enumerate(self.f.layout.form.centroid)
        entries = {first + k: f"{source}[{n}]" for n, k in numbers}
        return {f"{to}[{k}]": entries[k] for k in numbers_read if k in entries}

    def _read(self, array: str) -> tuple[int, ...]:
        """Entries that the function reads; in tasks of variations also those that move."""
        numbers = set(self.f.needs[array])
        if self.f.design:
            site, form = self.f.layout.site, self.f.layout.form
            first = len(site.coordinates) + len(site.data) + len(site.parameters)
            for k in self.f.needs["direction"]:
                if array == "dofs" and k >= first:
                    numbers.update(self._with_gradient(form.all, k - first))
                if array == "data" and 0 <= k - self.f.D < len(site.data):
                    n = k - self.f.D
                    if n in form.data:
                        some = [
                            m for m, q in form.data.items() if q.component == form.data[n].component
                        ]
                        numbers.update(some if form.data[n].axis is not None else [n])
        return tuple(sorted(numbers))

    def _with_gradient(self, quantities: Sequence[PointQuantity], k: int) -> list[int]:
        """A gradient entry with the others of its component, on which its variation depends."""
        q = quantities[k]
        if q.axis is None:
            return [k]
        return [
            m for m, o in enumerate(quantities) if o.component == q.component and o.axis is not None
        ]

    def _interpolated(
        self, source: str, quantities: dict[int, PointQuantity], array: str
    ) -> dict[str, str]:
        """Values and gradients of components at the point: entry of an array -> expression.

        source: the array of the element.
        """
        values: dict[str, str] = {}
        mark = {"us": "u", "es": "e", "ts": "t"}[source]
        for order in orders(list(quantities.values())):
            sums: dict[str, tuple[str, str]] = {}
            of_order = {k: q for k, q in quantities.items() if q.component.order == order}
            label = {
                c: f"{mark}{order}{chr(97 + c.is_data)}{n}"
                for n, c in enumerate(components(of_order.values()))
            }
            for q in of_order.values():
                at = f"{source}[{self._entry(q.component, source)}]"
                if q.axis is None:
                    sums[f"{label[q.component]}_v"] = (at, "N")
                else:
                    sums |= {f"{label[q.component]}_{k}": (at, f"D{k}") for k in range(self.f.D)}
            self.f.sums(order, sums)
            for k, q in of_order.items():
                c = label[q.component]
                slope = " + ".join(f"{c}_{m} * I{m}{q.axis}" for m in range(self.f.D))
                values[f"{array}[{k}]"] = f"{c}_v" if q.axis is None else slope
        return values

    def _entry(self, c: Component, source: str) -> str:
        stride = self.f.layout.entries(c)
        if source == "ts":
            first = 0 if self.f.task == Task.PRODUCT else self.f.first_dof
            if c.is_data:
                first = self.f.layout.d.coordinate_width
            return f"{first} + {stride.at('n')}"
        return stride.at("n")

    def _array(self, name: str, size: int, values: dict[str, str]) -> None:
        """Declare an argument of the function of the point and fill what it reads."""
        entries = {k: v for k, v in values.items() if k.startswith(f"{name}[")}
        self.f.out.add(f"V {name}[{max(size, 1)}];")
        for entry, value in entries.items():
            self.f.out.add(f"{entry} = {value};")

    def _point_data(self) -> None:
        d = self.f.layout.d
        count = len(d.point_data)
        self.f.out.add(f"V b[{max(count, 1)}];")
        if d.term_history:
            self._term_history(count)
        elif count and self.f.needs["point data"]:
            load(
                self.f.out,
                "b",
                f"a + {len(d.data)} + {count} * q",
                count,
                f"({len(d.data)} + {count * self.f.layout.points})",
            )

    def _term_history(self, count: int) -> None:
        """Data of the point where each term has history, and where this is."""
        f, d = self.f, self.f.layout.d
        width = f"({len(d.data)} + {point_expression(d)} * {f.layout.points})"
        first = count // 2 if d.point_rates else count
        f.out.add(f"const double *const at = a + {len(d.data)} + {point_expression(d)} * q;")
        for start, amount, source in (
            (0, first, "at"),
            (first, count - first, f"at + {first} + {terms_expression(d)}"),
        ):
            if amount:
                load(f.out, f"(b + {start})", source, amount, width)
        write, step = "0", "0"
        if f.task in AT_POINTS:
            step = f"({fields_expression(d)} * {f.layout.points})"
            write = f"R + {fields_expression(d)} * q + {len(d.fields)}"
        f.out.add(f"const softehl_terms terms = {{at + {first}, {width}, {write}, {step}}};")

    def _direction(self, values: dict[str, str]) -> dict[str, str]:
        """The argument t: how what the function reads moves."""
        form, site = self.f.layout.form, self.f.layout.site
        numbers = self.f.needs["direction"]
        if self.f.task == Task.PRODUCT:
            at = self._centroid("t", "dc", 0, numbers)
            return at | self._interpolated("ts", self._fields(numbers), "t")
        if not self.f.design:
            return {}
        first = self.f.D + len(site.data) + len(site.parameters)
        moved: dict[str, str] = {}
        if self.f.task == Task.FIELDS_RATE:
            some = self._fields(k - first for k in numbers if k >= first)
            moved |= self._interpolated("ts", {first + k: q for k, q in some.items()}, "t")
        moved |= self._centroid("t", "dc", first, numbers)
        data = {k: form.data[k - self.f.D] for k in numbers if k - self.f.D in form.data}
        moved |= self._interpolated("ts", data, "t")
        names, width = [a.name for a in self.f.layout.d.data], self.f.layout.d.coordinate_width
        for k in numbers:
            entry = f"t[{k}]"
            if k < self.f.D:
                moved[entry] = f"dX{k}"
            elif k < self.f.D + len(site.data):
                if k - self.f.D in form.data:
                    moved[entry] += self._drag(form.data, k - self.f.D, "e")
                else:
                    moved[entry] = f"ts[{width + names.index(site.data[k - self.f.D].name)}]"
            elif k < first:
                moved[entry] = f"ts[{width + len(names) + k - self.f.D - len(site.data)}]"
            else:
                quantities = dict(enumerate(form.all))
                start = moved.get(entry, "softehl_splat(0.0)")
                moved[entry] = start + self._drag(quantities, k - first, "g")
        return moved

    def _drag(self, quantities: Mapping[int, PointQuantity], k: int, array: str) -> str:
        """Change of a gradient by moving positions: - (gradient) L."""
        q = quantities[k]
        if q.axis is None:
            return ""
        others = {o.axis: m for m, o in quantities.items() if o.component == q.component}
        return "".join(f" - {array}[{others[m]}] * L{m}{q.axis}" for m in range(self.f.D))
