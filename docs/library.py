"""Write docs/library.md: entries of the library, their parameters, published numbers and ours.

python docs/library.py            all numbers anew (minutes)
python docs/library.py NAME ...   those of some entries; others stay as they are on the page
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from softehl.codegen.tools.library import built_in, entries  # noqa: E402
from tests.library.every import BENCHMARKS, CONVERGENCE  # noqa: E402

PAGE, NUMBERS = HERE / "library.md", HERE / "library.json"
INTRODUCTION = """# The library of elements and laws

`study.add("bar", element="truss", E=210e3, A=20.0)` and
`study.add("body", material="hencky", mu=0.4, kappa=2.0)` take an element and a law by name. Each is
a model file of at most 80 lines, derived and compiled at its first use. `softehl elements` lists
names, unknowns and parameters with units. `softehl elements --show truss` prints the file: copy it
as the start of a page of your own, or give it to `softehl generate` for another program. Every
entry is compared with a number from elsewhere; the tests run the same comparisons.

A whole study of a frame, with its mesh of straight members:

```python
from softehl import Mesh, Study

portal = Mesh.frame([(0, 0), (0, 3000), (4000, 3000), (4000, 0)], cells=16)
study = Study(portal)
study.add("frame", element="beam2d_reissner", EA=1e9, GA=1e9, EI=1e12)
study.fix((0, 0), u_x=0, u_y=0, theta=0)
study.fix((4000, 0), u_x=0, u_y=0, theta=0)
study.load((0, 3000), u_x=1000)
print(f"sway {study.solve().at((0, 3000))['u_x']:.2f} mm")
```

```text
sway 1.74 mm
```

Structures and solids at large displacements are nonlinear: linear published numbers are reached by
small loads. Fields of an element with one point (trusses, beams) are those of its middle. A
parameter that loads the body, such as `q_z`, acts in full from the start; `q_z=lambda t: 90 * t`
grows with the load factor. On a line a law is in uniaxial strain: a bar is `truss`, or a law on a
block. `theta_1`, `theta_2` of the shell turn its normal n about a and n x a.

![A slit ring lifted by a line force](pictures/library_slit_ring.png)
![A hemisphere pinched by two pairs of forces](pictures/library_hemisphere.png)
![A bar twisted until it yields](pictures/library_bar.png)

*Made by `result.plot(field, deformed=True, file=...)`: `shell_mitc4`, a slit ring
(deflection) and a hemisphere under F = 400 (u_x); `hencky_j2`, a bar twisted by a rigid end (von
Mises stress).*

"""


def main(names: list[str]) -> None:
    """Compute the numbers of some entries, all if none is named, and write the page."""
    numbers = json.loads(NUMBERS.read_text(encoding="utf-8")) if NUMBERS.exists() else {}
    for b in BENCHMARKS:
        if not names or b.entry in names or b.key not in numbers:
            numbers[b.key] = float(f"{b.run():.8g}")
            print(f"{b.key}: {numbers[b.key]:.6g} ({b.published:.6g})")
    for c in CONVERGENCE:
        for size in c.sizes:
            if not names or c.entry in names or c.key(size) not in numbers:
                numbers[c.key(size)] = float(f"{c.run(size):.8g}")
                print(f"{c.key(size)}: {numbers[c.key(size)]:.6g} ({c.published:.6g})")
    known = {b.key for b in BENCHMARKS} | {c.key(n) for c in CONVERGENCE for n in c.sizes}
    numbers = {key: v for key, v in sorted(numbers.items()) if key in known}
    NUMBERS.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(INTRODUCTION + "\n".join(_sections(numbers)), encoding="utf-8")


def _sections(numbers: dict[str, float]) -> list[str]:
    lines = []
    for kind, title in (("element", "Elements"), ("material", "Laws")):
        rows = [e for e in (entries() | built_in()).values() if e.kind == kind]
        lines += [
            f"## {title}",
            "",
            "| name | what it is | cells | unknowns | parameters | lines | source |",
        ]
        lines += ["|---|---|---|---|---|---|---|"]
        for e in rows:
            text = e.path.read_text(encoding="utf-8")
            length = "built in" if e.name in built_in() else len(text.splitlines())
            parameters = "; ".join(f"`{k}` {v}" for k, v in e.parameters.items())
            cells, unknowns = e.cells or "any", ", ".join(e.unknowns)
            lines.append(
                f"| `{e.name}` | {e.summary} | {cells} | {unknowns} | {parameters} | {length} | "
                f"{e.source} |"
            )
        lines.append("")
    lines += ["## Published numbers", "", "| entry | problem | published | ours | error | source |"]
    lines += ["|---|---|---|---|---|---|"]
    for b in BENCHMARKS:
        value = numbers[b.key]
        lines.append(
            f"| `{b.entry}` | {b.problem} | {b.published:.6g} | {value:.6g} | "
            f"{b.error(value):.1e} | {b.source} |"
        )
    sizes = CONVERGENCE[0].sizes
    lines += [
        "",
        "## Convergence of shells",
        "",
        "Deflections by those published; cells a side:",
        "",
    ]
    lines += [f"| problem | entry | published | {' | '.join(map(str, sizes))} | source |"]
    lines += ["|---|---|---|" + "---|" * len(sizes) + "---|"]
    for c in CONVERGENCE:
        shares = " | ".join(f"{numbers[c.key(size)] / c.published:.4f}" for size in c.sizes)
        lines.append(f"| {c.problem} | `{c.entry}` | {c.published:.5g} | {shares} | {c.source} |")
    return [*lines, ""]


if __name__ == "__main__":
    main(sys.argv[1:])
