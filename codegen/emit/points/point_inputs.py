"""Inputs of the function of a point: fields and slopes, data, history, and how they move."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from softehl.codegen.abi import Task
from softehl.codegen.emit.points.c_lines import load
from softehl.codegen.emit.points.loop_nest import Frame, components
from softehl.codegen.emit.points.point_layout import orders
from softehl.codegen.language.definition import Component, Quantity


@dataclass(frozen=True, eq=False)
class PointInputs:
    """The arguments of the function of a point, as lines of the frame `f`."""

    f: Frame

    def write(self, *, direction: bool = True) -> None:
        """The arrays x, g, e, b, t of the function of the point; without direction not t."""
        site, form = self.f.layout.site, self.f.layout.form
        known = self._interpolated("us", self._fields(self._read("dofs")), "g")
        known |= self._centroid("g", "c", 0, self._read("dofs"))
        data = {k: form.data[k] for k in self._read("data") if k in form.data}
        known |= self._interpolated("es", data, "e")
        names = [a.name for a in self.f.layout.d.data]
        for k in self._read("data"):
            if k not in form.data:
                known[f"e[{k}]"] = f"es[{names.index(site.data[k].name)}]"
        known |= {f"x[{k}]": f"X{k}" for k in self._read("coordinates")}
        self._array("x", self.f.D, known)
        self._array("g", len(form.all), known)
        self._array("e", len(site.data), known)
        self._point_data()
        if not direction:
            return
        moved = self._direction(known)
        width = 1 + max([*self.f.needs["direction"], 0])
        self._array("t", width, moved)

    def _fields(self, numbers: Iterable[int]) -> dict[int, Quantity]:
        """Unknowns by number, those at the centroid left out."""
        form = self.f.layout.form
        return {k: form.all[k] for k in numbers if k not in form.centroid}

    def _centroid(self, to: str, source: str, first: int, wanted: Sequence[int]) -> dict[str, str]:
        """Entries of an array that are values at the centroid, or their rates."""
        numbers = enumerate(self.f.layout.form.centroid)
        places = {first + k: f"{source}[{n}]" for n, k in numbers}
        return {f"{to}[{k}]": places[k] for k in wanted if k in places}

    def _read(self, array: str) -> tuple[int, ...]:
        """Entries that the function reads; in tasks of variations also those that move."""
        found = set(self.f.needs[array])
        if self.f.design:
            site, form = self.f.layout.site, self.f.layout.form
            first = len(site.coordinates) + len(site.data) + len(site.parameters)
            for k in self.f.needs["direction"]:
                if array == "dofs" and k >= first:
                    found.update(self._with_slopes(form.all, k - first))
                if array == "data" and 0 <= k - self.f.D < len(site.data):
                    n = k - self.f.D
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
            label = {
                c: f"{mark}{order}{chr(97 + c.given)}{n}"
                for n, c in enumerate(components(here.values()))
            }
            for q in here.values():
                at = f"{source}[{self._place(q.component, source)}]"
                if q.axis is None:
                    sums[f"{label[q.component]}_v"] = (at, "N")
                else:
                    sums |= {f"{label[q.component]}_{k}": (at, f"D{k}") for k in range(self.f.D)}
            self.f.sums(order, sums)
            for k, q in here.items():
                c = label[q.component]
                slope = " + ".join(f"{c}_{m} * I{m}{q.axis}" for m in range(self.f.D))
                found[f"{array}[{k}]"] = f"{c}_v" if q.axis is None else slope
        return found

    def _place(self, c: Component, source: str) -> str:
        place = self.f.layout.place(c)
        if source == "ts":
            first = 0 if self.f.task == Task.PRODUCT else self.f.first_dof
            if c.given:
                first = self.f.layout.d.coordinate_width
            return f"{first} + {place.at('n')}"
        return place.at("n")

    def _array(self, name: str, size: int, values: dict[str, str]) -> None:
        """Declare an argument of the function of the point and fill what it reads."""
        mine = {k: v for k, v in values.items() if k.startswith(f"{name}[")}
        self.f.out.add(f"V {name}[{max(size, 1)}];")
        for entry, value in mine.items():
            self.f.out.add(f"{entry} = {value};")

    def _point_data(self) -> None:
        d = self.f.layout.d
        count = len(d.point_data)
        self.f.out.add(f"V b[{max(count, 1)}];")
        if count and self.f.needs["point data"]:
            load(
                self.f.out,
                "b",
                f"a + {len(d.data)} + {count} * q",
                count,
                f"({len(d.data)} + {count * self.f.layout.points})",
            )

    def _direction(self, known: dict[str, str]) -> dict[str, str]:
        """The argument t: how what the function reads moves."""
        form, site = self.f.layout.form, self.f.layout.site
        wanted = self.f.needs["direction"]
        if self.f.task == Task.PRODUCT:
            at = self._centroid("t", "dc", 0, wanted)
            return at | self._interpolated("ts", self._fields(wanted), "t")
        if not self.f.design:
            return {}
        first = self.f.D + len(site.data) + len(site.parameters)
        moved: dict[str, str] = {}
        if self.f.task == Task.FIELDS_RATE:
            some = self._fields(k - first for k in wanted if k >= first)
            moved |= self._interpolated("ts", {first + k: q for k, q in some.items()}, "t")
        moved |= self._centroid("t", "dc", first, wanted)
        data = {k: form.data[k - self.f.D] for k in wanted if k - self.f.D in form.data}
        moved |= self._interpolated("ts", data, "t")
        names, width = [a.name for a in self.f.layout.d.data], self.f.layout.d.coordinate_width
        for k in wanted:
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

    def _drag(self, quantities: Mapping[int, Quantity], k: int, array: str) -> str:
        """Loss of a slope because the places move: - (slopes) L."""
        q = quantities[k]
        if q.axis is None:
            return ""
        others = {o.axis: m for m, o in quantities.items() if o.component == q.component}
        return "".join(f" - {array}[{others[m]}] * L{m}{q.axis}" for m in range(self.f.D))
