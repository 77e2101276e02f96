"""Map from the parent cell at a point: Jacobian, position, volume, and their variations."""

from __future__ import annotations

from softehl.codegen.abi import Task
from softehl.codegen.emit.points.loop_nest import Frame


def write(f: Frame) -> None:
    """Write the Jacobian, its inverse I (parent by reference coordinate), position, volume."""
    out, D = f.out, f.D
    sums = {f"J{i}{k}": (f"xs[{D} * n + {i}]", f"D{k}") for i in range(D) for k in range(D)}
    if f.needs["coordinates"] or f.ring:
        sums |= {f"X{i}": (f"xs[{D} * n + {i}]", "N") for i in range(D)}
    if f.design:
        sums |= {f"dJ{i}{k}": (f"ts[{D} * n + {i}]", f"D{k}") for i in range(D) for k in range(D)}
        sums |= {f"dX{i}": (f"ts[{D} * n + {i}]", "N") for i in range(D)}
    f.sums(f.layout.geometry.order, sums)
    write_inverse(f)
    out.idle(["det", *(f"I{k}{m}" for k in range(D) for m in range(D))])
    if f.design:
        _moved(f)
    if f.to_unknowns or f.task == Task.ENERGY:
        ring = " * (6.283185307179586 * X1)" if f.ring else ""
        out.add(f"const V w = det * {f.layout.tables}_W[q]{ring};")


def write_inverse(f: Frame) -> None:
    out = f.out
    if f.D == 1:
        out.add("const V det = J00, I00 = 1.0 / det;")
    elif f.D == 2:
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


def _moved(f: Frame) -> None:
    """Write the gradient L of the variation of positions, and the relative change of volume."""
    out, D = f.out, f.D
    for i in range(D):
        for j in range(D):
            total = " + ".join(f"dJ{i}{k} * I{k}{j}" for k in range(D))
            out.add(f"const V L{i}{j} = {total};")
    ring = " + dX1 / X1" if f.ring else ""
    out.add(f"const V swell = {' + '.join(f'L{i}{i}' for i in range(D))}{ring};")
    moved = [f"L{i}{j}" for i in range(D) for j in range(D)]
    out.idle(["swell", *moved, *(f"dX{i}" for i in range(D))])
