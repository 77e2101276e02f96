"""The pictures of the gallery, from the lines of its pages: `make pictures`.

An entry's blocks are run, and what they leave behind is drawn.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from tests.docs.pages import Reader, blocks

HERE = Path(__file__).resolve().parent
SIZE = (7.2, 2.7)  # inches
BLUE, ORANGE, GREEN, GREY = "#1f5fa8", "#d9661f", "#3b8f4a", "0.45"

_STYLE: Any = {
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.linewidth": 0.7,
    "figure.dpi": 160,
    "font.size": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "lines.markersize": 4,
}


def main(names: list[str]) -> None:
    """Draw these entries, or all of them."""
    matplotlib.use("agg")
    with matplotlib.rc_context(_STYLE):
        for name in names or ENTRIES:
            figure = Figure(SIZE, layout="constrained")
            with namespace(name) as space:
                ENTRIES[name](figure, space)
            save(figure, HERE / "pictures" / f"{name}.png")


@contextlib.contextmanager
def namespace(entry: str) -> Iterator[dict[str, Any]]:
    """Namespace that the blocks of an entry leave, in the folder in which they were run."""
    reader = Reader(HERE / "models")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for block in blocks((HERE / f"{entry}.md").read_text(encoding="utf-8")):
            reader.read(block)
        yield reader.namespace


def save(figure: Figure, path: Path) -> None:
    """With 128 colours: small files, the same every time."""
    figure.savefig(path, metadata={"Software": None})
    with Image.open(path) as picture:
        small = picture.convert("RGB").quantize(128, dither=Image.Dither.NONE)
    small.save(path, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def draw_cells(axes: Any, places: Any, cells: Any, values: Any, **given: Any) -> Any:
    """Cells with one value each; their corners come first."""
    drawn = PolyCollection(places[cells[:, :4]], array=values, edgecolors="face", **given)
    axes.add_collection(drawn)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return drawn


def cook(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.25])
    result = space["panel"](16)
    mesh = result.system.mesh
    drawn = draw_cells(
        left,
        result.deformed(("u_x", "u_y")),
        mesh.cells["quad4"],
        result.fields("rubber")["sigma_xx"].mean(axis=1),
        cmap="RdBu_r",
        clim=(-0.15, 0.15),
    )
    outline = np.array([(0, 0), (48, 44), (48, 60), (0, 44), (0, 0)])
    left.plot(*outline.T, color=GREY, lw=0.8, ls="--")
    figure.colorbar(drawn, ax=left, label="Cauchy stress along x [MPa]", shrink=0.85)
    sizes = (1, 2, 4, 8, 16)
    flat = [space["panel"](n).at((48, 60))["u_y"] for n in sizes]
    thick = [space["thick"](n).at((48, 60, 0))["u_y"] for n in sizes]
    right.plot(sizes, thick, "o-", color=BLUE, label="free across its thickness (hex8)")
    right.plot(sizes, flat, "s-", color=ORANGE, label="plane strain (quad4)")
    theirs = [5.154, 8.724, 12.025, 13.608, 14.129]
    right.plot(sizes, theirs, "k+", ms=9, label="deal.II, Q1")
    right.set_xscale("log", base=2)
    right.set_xticks(sizes, [str(n) for n in sizes])
    right.set(xlabel="cells along a side", ylabel="lift of the upper corner [mm]", ylim=(0, 16))
    right.legend(loc="lower right")


def fit(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.25])
    truth, slopes = space["truth"], space["slopes"]
    mesh = truth.system.mesh
    drawn = mesh.cells["quad4"]
    draw_cells(left, mesh.points, drawn, np.zeros(len(drawn)), cmap="Greys", clim=(-0.2, 1.5))
    nodes = mesh.nodes("boundary")
    arrows = np.stack([slopes["nodes", axis][nodes] for axis in "xy"])
    left.quiver(*mesh.points[nodes].T, *arrows, color=BLUE, angles="xy", width=0.008)
    left.set(xlim=(-10, 62), ylim=(-4, 68), title="slope of the lift by places of nodes")
    moduli = np.linspace(0.3, 0.7, 5)
    lifts, tangents = [], []
    for mu in moduli:
        result = space["panel"](mu, 0.9154).solve(steps=4)
        lifts.append(result.at((48, 60))["u_y"])
        tangents.append(result.sensitivity("u_y", at=(48, 60), by={"rubber": "mu"}))
    right.plot(moduli, lifts, "o", color=BLUE, label="solutions")
    for mu, lift, slope in zip(moduli, lifts, tangents, strict=True):
        ends = np.array([-0.04, 0.04])
        right.plot(mu + ends, lift + ends * slope["rubber", "mu"], color=ORANGE)
    right.plot([], [], color=ORANGE, label="tangents")
    right.set(xlabel="shear modulus [MPa]", ylabel="lift of the upper corner [mm]")
    right.legend()


def plasticity(figure: Figure, space: dict[str, Any]) -> None:
    early, late, right = figure.subplots(1, 3, width_ratios=[1, 1, 1.4])
    path, W = space["pulled"](16), space["W"]
    first = next(r for r in path if r.t > 0.149)
    for axes, result, most in ((early, first, 1.0), (late, path[-1], 10.0)):
        mesh, alpha = result.system.mesh, result.fields("steel")["alpha"].mean(axis=1)
        places = result.deformed(("u_x", "u_y")) if result is path[-1] else mesh.points
        drawn = draw_cells(
            axes, places, mesh.cells["quad8"], 100 * alpha, cmap="magma_r", clim=(0, most)
        )
        axes.set_title(f"pulled by {0.2 * result.t:.2f} mm")
        figure.colorbar(drawn, ax=axes, label="plastic strain [%]", extend="max", shrink=0.8)
    for name, colour, marker in (("coarse", BLUE, "s"), ("fine", ORANGE, "o")):
        steps = space[name]
        pulled = [0.2 * r.t for r in steps]
        stress = [r.reaction("end")["u_y"] / W for r in steps]
        label = f"{len(steps[0].system.mesh.cells['quad8'])} cells"
        right.plot(pulled, stress, marker + "-", color=colour, ms=3, label=label)
    right.axhline(space["limit"], color="k", ls="--", lw=0.9, label="exact limit load")
    right.set(xlabel="displacement of the end [mm]", ylabel="mean stress at the end [MPa]")
    right.set(xlim=(0, 0.205), ylim=(0, 290))
    right.legend(loc="lower right")


def balloon(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.3])
    results, stretch = space["path"].results, space["stretch"]
    angle = np.linspace(0, np.pi, 181)
    arc = np.column_stack([np.cos(angle), np.sin(angle)])
    for wanted, colour in zip(
        (6.0, 3.3, 1.53, 1.0), ("#c6dbef", "#6baed6", BLUE, "k"), strict=True
    ):
        result = min(results, key=lambda r: abs(stretch(r) - wanted))
        ends = result.system.mesh.points[:, 0] + result.values("u")
        inside, outside = ends.min(), ends.max()
        ring = np.vstack([inside * arc, outside * arc[::-1]])
        left.fill(*ring.T, color=colour, lw=0.5, label=f"stretch {stretch(result):.2f}")
    left.set_aspect("equal")
    left.set_axis_off()
    left.legend(loc="lower center", bbox_to_anchor=(0.5, -0.28), ncols=2)
    fine = np.linspace(1.0005, 6.0, 300)
    right.plot(fine, [1e3 * space["exact"](s) for s in fine], color=GREY, label="quadrature")
    right.plot(
        [stretch(r) for r in results],
        [1e3 * r.t for r in results],
        "o",
        color=BLUE,
        ms=3,
        label="arc length",
    )
    for limit in space["path"].limits:
        here = 1 + limit.x[0] / space["A"]
        right.plot(here, 1e3 * limit.parameter, "D", color=ORANGE, ms=6)
        text = f"{limit.kind} {1e3 * limit.parameter:.2f} kPa"
        below = limit.kind == "minimum"
        shift = (0, -14) if below else (8, 8)
        right.annotate(
            text, (here, 1e3 * limit.parameter), shift, textcoords="offset points", color=ORANGE
        )
    right.set(xlabel="stretch of the inside", ylabel="pressure of the gas [kPa]")
    right.set(xlim=(0.9, 6.1), ylim=(0, 75))
    right.legend(loc="lower right")


def heat(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    results = space["heating"]
    place = results[0].system.mesh.points[:, 0]
    for wanted, colour in ((9, "#9ecae1"), (60, "#6baed6"), (200, BLUE), (600, "#08306b")):
        result = min(results, key=lambda r: abs(r.t - wanted))
        left.plot(place, result.values("T"), color=colour, label=f"{result.t:.0f} s")
    left.plot(place, space["steady"].values("T"), "k--", lw=1, label="steady")
    left.plot(0.1, 927.0, "k+", ms=10, label="NAFEMS T2")
    left.set(xlabel="place [m]", ylabel="temperature [K]", ylim=(-20, 1050))
    left.legend(loc="lower left", ncols=2)
    results = space["swinging"](80, 0.125)
    times = [r.t for r in results]
    for x, colour in ((0.1, GREY), (0.09, "#6baed6"), (0.08, BLUE), (0.06, ORANGE)):
        right.plot(times, [r.at((x,))["T"] for r in results], color=colour, label=f"at {x} m")
    right.plot(32, 36.60, "k+", ms=10, label="NAFEMS T3")
    right.set(xlabel="time [s]", ylabel="temperature [°C]", xlim=(0, 33), ylim=(-5, 135))
    right.legend(loc="upper left", ncols=2)


def fbar(figure: Figure, space: dict[str, Any]) -> None:
    first, second, right = figure.subplots(1, 3, width_ratios=[1, 1, 1.5])
    for axes, model, words in ((first, "standard", "standard"), (second, "potential", "F-bar")):
        result = space["panel"](model, 20)
        drawn = draw_cells(
            axes,
            result.deformed(("u_x", "u_y")),
            result.system.mesh.cells["quad4"],
            result.fields("rubber")["pressure"].mean(axis=1),
            cmap="RdBu_r",
            clim=(-25, 25),
        )
        axes.set_title(words)
    bar = figure.colorbar(drawn, ax=(first, second), label="pressure [MPa]", extend="both")
    bar.ax.tick_params(labelsize=7.5)
    sizes = (2, 4, 10, 15, 20)
    looks = {"standard": ("o-", GREY), "potential": ("o-", BLUE)}
    looks |= {"classical": ("s-", ORANGE), "spatial": ("^-", "#6baed6")}
    for model, (marker, colour) in looks.items():
        lifts = [space["panel"](model, n).at((48, 60))["u_y"] for n in sizes]
        right.plot(sizes, lifts, marker, color=colour, ms=3, label=model)
    theirs = [6.1414, 6.7463, 6.8242, 6.8589]
    right.plot(sizes[1:], theirs, "k+", ms=9, label="OpenGeoSys, F-bar")
    right.plot(sizes[1:], [2.2867, 2.8407, 3.3746, 3.8812], "kx", ms=5, label="the same, standard")
    right.set(xlabel="cells along a side", ylabel="lift of the upper corner [mm]", ylim=(0, 7.5))
    right.set_xticks(sizes)
    right.legend(loc="lower right", ncols=2, fontsize=7)


def cahn_hilliard(figure: Figure, space: dict[str, Any]) -> None:
    *maps, right = figure.subplots(1, 4, width_ratios=[1, 1, 1, 1.5])
    results = space["results"]
    for axes, wanted in zip(maps, (0.002, 0.04, 0.2), strict=True):
        result = min(results, key=lambda r: abs(r.t - wanted))
        mesh, c = result.system.mesh, result.values("c")
        x, y = mesh.points.T
        drawn = axes.tricontourf(x, y, c, levels=np.linspace(-1.1, 1.1, 23), cmap="RdBu_r")
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_title(f"t = {result.t:.3f}")
    figure.colorbar(drawn, ax=maps, label="concentration", ticks=[-1, 0, 1], shrink=0.7)
    right.plot([r.t for r in results], space["energy"], color=BLUE)
    right.set(xlabel="time", ylabel="energy", ylim=(0, 0.26), xlim=(0, 0.2))


def friction(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    path, mu, stresses = space["fine"][1], space["mu"], space["stresses"]
    x, _, p, _ = stresses(path[0])
    left.plot(x, mu * p, color=GREY, label="friction times pressure")
    for result, colour in zip(path[1::2], ("#9ecae1", BLUE, "#08306b"), strict=True):
        x, _, _, tau = stresses(result)
        left.plot(
            x, tau, "o-", color=colour, ms=2.5, label=f"pushed {0.12 * (result.t - 1):.3f} mm"
        )
    left.set(xlabel="place [mm]", ylabel="stress [MPa]", xlim=(-1.6, 1.6), ylim=(0, None))
    left.legend(loc="upper center", bbox_to_anchor=(0.5, 1.25), ncols=2, fontsize=6.5)
    parts = np.linspace(0, 1, 200)
    right.plot(parts, np.sqrt(1 - parts), color=GREY, label="Cattaneo, Mindlin")
    for name, colour, marker in (("coarse", "#6baed6", "s"), ("fine", ORANGE, "o")):
        found = [stresses(result) for result in space[name][1]]
        part = [(tau @ w) / (mu * (p @ w)) for _, w, p, tau in found]
        sticks = [w[(p > 0) & (tau < mu * p * (1 - 1e-9))].sum() for _, w, p, tau in found]
        half = [s / (2 * space["a"]) for s in sticks]
        label = f"{len(found[0][0]) // 2} cells a side"
        right.plot(part, half, marker, color=colour, label=label)
    right.set(xlabel="Q / (friction P)", ylabel="what sticks / contact", xlim=(0, 1), ylim=(0, 1.1))
    right.legend(loc="lower left")


def maxwell(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    t = np.linspace(0.05, 3, 200)
    left.plot(t, 0.01 * (1 + 3 * np.exp(-(t - 0.05) / 0.5)), color=GREY, label="closed form")
    left.plot(space["t"], space["stress"], "o", color=BLUE, label="steps of 0.1 s")
    left.set(xlabel="time [s]", ylabel="shear stress [MPa]", ylim=(0, 0.045))
    left.legend()
    omega = np.geomspace(0.2, 40, 100)
    w2 = (0.5 * omega) ** 2
    right.plot(omega, 1 + 3 * w2 / (1 + w2), color=GREY, label="closed forms")
    right.plot(omega, 3 * 0.5 * omega / (1 + w2), color=GREY)
    some = np.array([0.25, 0.5, 1, 2, 4, 8, 16, 32])
    found = np.array([space["moduli"](one, 50) for one in some])
    right.plot(some, found[:, 0], "o", color=BLUE, label="storage modulus")
    right.plot(some, found[:, 1], "s", color=ORANGE, label="loss modulus")
    right.set(xscale="log", xlabel="angular frequency [1/s]", ylabel="[MPa]", ylim=(0, 4.8))
    right.legend(loc="upper left", ncols=1)


def seal(figure: Figure, space: dict[str, Any]) -> None:
    early, late, right = figure.subplots(1, 3, width_ratios=[1, 1, 1.3])
    path = space["squeezed"](3)
    for axes, result in ((early, path[len(path) // 2]), (late, path[-1])):
        cells = result.system.mesh.cells["quad9"]
        places = result.deformed(("u_x", "u_y"))
        values = result.fields("rubber")["mises"].mean(axis=1)
        for side in (1, -1):
            drawn = draw_cells(
                axes, places * [side, 1], cells, values, cmap="viridis", clim=(0, 0.6)
            )
        axes.set_title(f"{2.2 * result.t:.1f} mm", fontsize=8.5)
    figure.colorbar(drawn, ax=late, label="von Mises [MPa]", shrink=0.8)
    right.plot(space["stroke"], space["force"], "o-", ms=3, color=BLUE)
    right.axvline(1.1, color=GREY, lw=0.8, ls="--")
    right.annotate("half the stroke", (1.12, 0.02), color=GREY)
    right.set(xlabel="stroke [mm]", ylabel="force on half the seal [N/mm]", ylim=(0, 0.65))


def finite_plasticity(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.6])
    result = space["perfect"][-1]
    cells, places = result.system.mesh.cells["quad8"], result.deformed(("u_x", "u_y"))
    alpha = result.fields("steel")["alpha"].mean(axis=1)
    for sides in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        drawn = draw_cells(left, places * sides, cells, alpha, cmap="viridis", clim=(0, 0.8))
    figure.colorbar(drawn, ax=left, label="equivalent plastic strain", shrink=0.85)
    for name, color in (("hardening", ORANGE), ("perfect", BLUE)):
        path = space[name]
        load = [r.reaction("end")["u_y"] / space["W"] / space["limit"] for r in path]
        label = {"perfect": "perfectly plastic", "hardening": "hardening, H = 1000 MPa"}[name]
        right.plot([r.t for r in path], load, "o-", ms=3, color=color, label=label)
    right.axhline(1.0, color=GREY, lw=0.8, ls="--")
    right.set(xlabel="displacement of the end [mm]", ylabel="load / limit load", ylim=(0, 1.4))
    right.legend(loc="lower right")


def stick_slip(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    path, nearest = space["path"], space["nearest"]
    for t, color in ((0.5, BLUE), (1.0, ORANGE), (3.0, GREY)):
        result = path[nearest(t)]
        x = np.linspace(0.5, 99.5, 100)
        stress = result.fields("floor")["traction"].mean(axis=1)
        label = f"end at {space['end_stress'](result.t):+.2f} MPa"
        left.plot(x, stress, color=color, label=label)
    left.set(xlabel="along the floor [mm]", ylabel="friction [MPa]", ylim=(-0.013, 0.017))
    left.legend(loc="upper left")
    moved, bar, top = space["moved"], space["bar"], space["largest"]
    right.plot(moved[:, 1], moved[:, 0], ".", color=BLUE, label="block")
    s = np.linspace(0, top, 50)
    right.plot([bar(v) for v in s], s, color=GREY, label="bar")
    s = np.linspace(top, -top, 100)
    right.plot([bar(top) - 2 * bar((top - v) / 2) for v in s], s, color=GREY)
    right.set(xlabel="displacement of the end [mm]", ylabel="stress at the end [MPa]")
    right.legend(loc="upper left")


def fracture(figure: Figure, space: dict[str, Any]) -> None:
    early, late, right = figure.subplots(1, 3, width_ratios=[1, 1, 1.5])
    path, force, pulled = space["path"], space["force"], space["pulled"]
    for axes, result in ((early, space["loaded"]), (late, path[-1])):
        mesh, d = result.system.mesh, result.values("d")
        cells = mesh.cells["quad4"]
        places = mesh.points + 20 * np.column_stack([result.values(n) for n in ("u_x", "u_y")])
        for side in (1, -1):
            drawn = draw_cells(
                axes, places * [1, side], cells, d[cells].mean(axis=1), cmap="magma_r", clim=(0, 1)
            )
        axes.set_title(f"{1e3 * pulled(result.t):.2f} µm")
    figure.colorbar(drawn, ax=late, label="phase field", shrink=0.8)
    opened = [1e3 * pulled(r.t) for r in path]
    right.plot([0, *opened], [0, *force], color=BLUE, label="plate")
    limits = {"Griffith": (space["griffith"], GREY), "as wide as cells": (space["wide"], ORANGE)}
    for label, (place, colour) in limits.items():
        right.axvline(1e3 * place, color=colour, lw=0.8, ls="--", label=label)
    right.set(xlabel="displacement [µm]", ylabel="force [N]", xlim=(0, 5.3), ylim=(0, 600))
    right.legend(loc="upper left")


def contact(figure: Figure, space: dict[str, Any]) -> None:
    left, middle, right = figure.subplots(1, 3, width_ratios=[1, 1, 1.2])
    x, p, a = space["x"], space["p"], space["a"]
    order = np.argsort(x)
    s = np.linspace(-1, 1, 200)
    left.plot(x[order] / a, p[order], ".", color=BLUE, label="computed")
    left.plot(s, p.max() * np.sqrt(1 - s**2), color=GREY, lw=1, label="Hertz")
    left.set(xlabel="x / a", ylabel="pressure [MPa]", xlim=(-1.5, 1.5))
    left.legend(loc="lower center")
    middle.plot(space["way"], 1e3 * space["load"], "o-", color=BLUE)
    middle.set(xlabel="way of the disc [mm]", ylabel="reaction [mN/mm]", ylim=(0, 160))
    result = space["closed"][-1]
    mesh, found = result.system.mesh, result.fields("contact")
    places = result.deformed(("u_x", "u_y"))
    flat = np.zeros(len(mesh.cells["quad4"]))
    draw_cells(right, places, mesh.cells["quad4"], flat, cmap="Greys", clim=(-1, 5))
    drawn = right.scatter(found["x"], found["y"], 4, found["pressure"], cmap="magma_r")
    figure.colorbar(drawn, ax=right, label="pressure [MPa]", shrink=0.8)


def column(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    study, mass, first = space["study"], space["mass"], space["euler"][0]
    shares = np.linspace(0.0, 0.99, 8)
    states = [study.solve(until=s * first).modes(1, mass=mass).squares[0] for s in shares]
    left.plot(shares, 1 - shares, color=GREY, label="linear")
    left.plot(shares, np.array(states) / space["free"].squares[0], "o", color=BLUE, label="modes")
    left.set_xlabel("load over Euler's")
    left.set_ylabel("frequency squared")
    left.legend()
    for state in space["path"].results[::3]:
        points = state.deformed(("u_x", "u_y"))
        edge = points[study.mesh.nodes("bottom")]
        edge = edge[np.argsort(study.mesh.points[study.mesh.nodes("bottom"), 0])]
        side = np.sign(edge[-1, 1]) or 1.0
        right.plot(edge[:, 0], side * edge[:, 1], color=BLUE, lw=1)
    loads = np.linspace(1.001, space["path"].results[-1].t / first, 200)
    x, y = np.array([space["curve"](load) for load in loads]).T
    right.plot(x, y, "--", color=ORANGE, label="end of an elastica")
    right.set_aspect("equal")
    right.set_xlabel("mm")
    right.legend(loc="lower left")


def swing(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.5])
    mesh = space["study"].mesh
    (cells,) = mesh.cells.values()
    for state, colour in zip(
        space["paths"]["midpoint"][9:31:7], ("#c6dbef", "#6baed6", BLUE, "k"), strict=True
    ):
        places = state.deformed(("u_x", "u_y"))
        drawn = PolyCollection(places[cells[:, :4]], facecolors="none", edgecolors=colour)
        left.add_collection(drawn)
    left.autoscale_view()
    left.set_aspect("equal")
    left.set_axis_off()
    for (name, states), colour in zip(space["paths"].items(), (BLUE, ORANGE, GREY), strict=True):
        total = np.array([s.energy["kinetic"] + s.energy["internal"] for s in states])
        time = np.array([s.t for s in states]) / space["period"]
        right.plot(time, 100 * (total / total[0] - 1), color=colour, label=name, lw=1)
    right.set_xlabel("periods")
    right.set_ylabel("change of the energy [%]")
    right.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=7)


def impact(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    left.plot([0, 0, 1, 1, 1.5], [0, 1, 1, 0, 0], "k", lw=0.8, label="De Saint-Venant")
    left.plot(space["times"], space["stresses"], color=ORANGE, label="60 cells a bar")
    left.set(xlabel="t c / (2 L)", ylabel="stress / (rho c v / 2)", ylim=(-0.1, 1.35))
    left.legend(loc="upper center", ncols=2, fontsize=7)
    side = space["left"]
    for part, label, colour in ((side, "first bar", BLUE), (~side, "second bar", GREEN)):
        mean = [s.velocity("u_x")[part].mean() / space["v"] for s in space["states"]]
        right.plot(space["times"], mean, color=colour, label=label)
    right.set(xlabel="t c / (2 L)", ylabel="mean speed / v")
    right.legend(loc="center right")


def adhesion(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    for (maugis, path), colour in zip(space["paths"].items(), (BLUE, ORANGE), strict=True):
        force = space["force"]
        way = [result.t for result in path]
        left.plot(way, list(map(force, path)), color=colour, label=f"lambda = {maugis}")
        found = max(path, key=force).fields("contact")
        order = np.argsort(found["y"])
        s = found["tension"].max()
        right.plot(found["y"][order], found["tension"][order] / s, color=colour)
    for value, name in ((2.0, "Bradley"), (1.5, "JKR")):
        left.axhline(value, color=GREY, lw=0.8)
        left.text(1.0, value + 0.03, name, ha="right", color=GREY, fontsize=7)
    left.set(xlabel="pull / last pull", ylabel="force / (pi w R)", ylim=(0, 2.3))
    left.legend(loc="upper right", bbox_to_anchor=(1.0, 0.65), fontsize=7)
    right.set(xlabel="radius [mm]", ylabel="tension / strength", ylim=(-0.6, 1.1))


def rigid(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2)
    for turn, colour in zip((0.25, 0.5, 0.75, 1.0), (GREY, GREEN, BLUE, ORANGE), strict=True):
        state = min(space["states"], key=lambda state: abs(state.t - turn))
        ((_, faces),) = state.system.mesh.faces("bottom").items()
        nodes = np.unique(faces)
        place = state.system.mesh.points[nodes]
        moved = place + np.stack([state.values(n)[nodes] for n in ("u_x", "u_y")], axis=1)
        order = np.argsort(place[:, 0])
        left.plot(*moved[order].T, color=colour, label=f"{state.t:.2f} turn")
    left.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    left.legend(fontsize=7, loc="upper right")
    y, p = (space["fields"][n].ravel() for n in ("y", "pressure"))
    near, r = y < 2 * space["a"], np.linspace(0, 1, 200)
    right.plot(r, np.sqrt(1 - r**2), "k", lw=0.8, label="Hertz")
    right.plot(
        y[near] / space["a"], p[near] / space["peak"], ".", color=ORANGE, label="60 x 60 cells"
    )
    right.set(xlabel="r / a", ylabel="pressure / peak of Hertz")
    right.legend()


def laminate(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    result = space["sheared"].result
    mesh, places = result.system.mesh, result.deformed(("u_x", "u_y"))
    for name in ("stiff", "soft"):
        drawn = draw_cells(
            left,
            places,
            mesh.cells_of(name)["quad4"],
            result.fields(name)["W"].mean(axis=1),
            cmap="viridis",
            clim=(0.0, 0.3),
        )
    left.autoscale_view()
    figure.colorbar(drawn, ax=left, label="energy per volume [MPa]", shrink=0.85)
    shares = np.linspace(0.0, 1.0, 60)
    exact = np.array([space["backus"](s) for s in shares])
    there = np.array([0.1, 0.25, 0.5, 0.75, 0.9])
    found = [space["moduli"](space["laminate"](s).solve(np.eye(2)).A) for s in there]
    for k, name in enumerate(("xxxx", "xxyy", "yyyy", "xyxy")):
        (line,) = right.plot(shares, exact[:, k], lw=1, label=f"$A_{{{name}}}$")
        right.plot(there, np.array(found)[:, k], "o", color=line.get_color())
    right.set_xlabel("share of stiff layers")
    right.set_ylabel("MPa")
    right.legend()


def enhanced(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1])
    for model, colour in (("plain", ORANGE), ("enhanced", BLUE)):
        result = space["beam"](model, tilt=0.2)
        mesh = result.system.mesh
        places = mesh.points + 4e6 * (result.deformed(("u_x", "u_y")) - mesh.points)
        (cells,) = mesh.cells.values()
        left.add_collection(PolyCollection(places[cells], facecolors="none", edgecolors=colour))
    left.autoscale_view()
    left.set_aspect("equal")
    left.set_axis_off()
    near = 10.0 ** -np.arange(0, 5.5, 0.5)
    for model, tilt, mark, label in (
        ("enhanced", 0, "o", "Q1E4"),
        ("enhanced", 0.2, "^", "Q1E4, trapezoids"),
        ("plain", 0, "s", "Q1"),
    ):
        lifts = [
            space["lift"](space["beam"](model, tilt, nu))[0] / space["exact"](nu)
            for nu in (1 - near) / 2
        ]
        colour = ORANGE if model == "plain" else BLUE
        right.plot(near, lifts, mark, color=colour, label=label)
    fine = np.logspace(-5, 0, 100)
    right.plot(fine, space["locked"]((1 - fine) / 2), color=GREY, lw=1, label="closed forms")
    right.axhline(1, color=GREY, lw=1)
    right.set(xscale="log", xlabel="1 - 2 nu", ylabel="lift / theory of beams")
    right.invert_xaxis()
    right.legend(loc="center right")


def jumps(figure: Figure, space: dict[str, Any]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.3])
    result = space["results"][1][0]
    mesh, u = result.system.mesh, result.values("u")
    (cells,) = mesh.cells.values()
    triangles = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    drawn = left.tripcolor(*mesh.points.T, triangles, u, shading="gouraud", cmap="RdBu_r")
    left.set_aspect("equal")
    left.set_axis_off()
    figure.colorbar(drawn, ax=left, label="u", shrink=0.85)
    sizes = np.array([8, 16, 32])
    for order, colour in ((1, BLUE), (2, ORANGE), (3, GREEN)):
        errors = [space["error"](found) for found in space["results"][order]]
        right.plot(sizes, errors, "o", color=colour, label=f"order {order}")
    right.plot(sizes, [9.605e-05, 5.606e-06, 3.484e-07], "k+", ms=9, label="deal.II, order 3")
    for order in (1, 2, 3):
        label = "least error" if order == 1 else None
        right.plot(sizes, space["best"](sizes, order), color=GREY, lw=1, label=label)
    right.set(xscale="log", yscale="log", xlabel="cells along a side", ylabel="error")
    right.set_xticks(sizes, [str(n) for n in sizes])
    right.minorticks_off()
    right.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def two_scales(figure: Figure, space: dict[str, Any]) -> None:
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.3, 1, 1.1])
    coarse, limits = space["coarse"], (0.85, 1.15)
    state = coarse.unit_cell("foam", 0, 0).result
    for axes, result, block, kind in (
        (left, coarse, "foam", "quad9"),
        (middle, state, "walls", "quad4"),
    ):
        fields = result.fields(block)
        if block == "foam":
            F = [fields[f"F_{ij}"].mean(axis=1) for ij in ("xx", "yy", "xy", "yx")]
            J = F[0] * F[1] - F[2] * F[3]
        else:
            J = fields["J"].mean(axis=1)
        quads = result.system.mesh.cells[kind][:, :4]
        places = result.deformed(("u_x", "u_y"))
        drawn = draw_cells(axes, places, quads, J, cmap="viridis", clim=limits)
        axes.autoscale_view()
    figure.colorbar(drawn, ax=middle, label="volume ratio", shrink=0.85)
    tips = space["tips"]
    right.plot(list(tips), list(tips.values()), "o-", label="resolved")
    right.axhline(coarse.at((2, 0.5))["u_y"], color=GREY, ls="--", label="two scales")
    right.set_xlabel("cells along a unit of length")
    right.set_ylabel("deflection [mm]")
    right.legend()


ENTRIES: dict[str, Callable[[Figure, dict[str, Any]], None]] = {
    "cook": cook,
    "plasticity": plasticity,
    "balloon": balloon,
    "heat": heat,
    "fbar": fbar,
    "cahn-hilliard": cahn_hilliard,
    "friction": friction,
    "fit": fit,
    "maxwell": maxwell,
    "seal": seal,
    "finite-plasticity": finite_plasticity,
    "stick-slip": stick_slip,
    "fracture": fracture,
    "contact": contact,
    "column": column,
    "swing": swing,
    "enhanced": enhanced,
    "jumps": jumps,
    "laminate": laminate,
    "two-scales": two_scales,
    "impact": impact,
    "rigid": rigid,
    "adhesion": adhesion,
}

if __name__ == "__main__":
    main(sys.argv[1:])
