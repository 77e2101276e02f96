"""Notebooks of gallery entries, from their pages: `python docs/notebooks/make.py` renews them.

A page is the only source. Its prose becomes cells of text, its model page a cell that writes the
file, its code cells; what they print is left out and comes back when the notebook is run. A last
cell draws.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

HERE = Path(__file__).resolve().parent
GALLERY = HERE.parent / "gallery"
_FENCE = re.compile(r"^```(\S+)[ ]?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

DRAWN = {
    "cook": """\
import matplotlib.pyplot as plt

result = panel(16)
cells = result.system.mesh.cells["quad4"]
plt.tripcolor(
    *result.deformed(("u_x", "u_y")).T,
    triangles=np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]),
    facecolors=np.tile(result.fields("rubber")["sigma_xx"].mean(axis=1), 2),
    cmap="RdBu_r",
)
plt.colorbar(label="Cauchy stress along x [MPa]")
plt.axis("equal");
""",
    "fracture": """\
import matplotlib.pyplot as plt

opened = [1e3 * pulled(result.t) for result in path]
plt.plot([0, *opened], [0, *force], label="plate")
plt.axvline(1e3 * griffith, ls="--", color="0.5", label="Griffith")
plt.xlabel("displacement [um]")
plt.ylabel("force [N]")
plt.legend();
""",
    "two-scales": """\
import matplotlib.pyplot as plt

plt.plot(tips.keys(), tips.values(), "o-", label="all holes resolved")
plt.axhline(coarse.at((2, 0.5))["u_y"], ls="--", color="0.5", label="two scales")
plt.xlabel("cells along a unit of length")
plt.ylabel("deflection [mm]")
plt.legend();
""",
}
"""The last cell of each notebook; what it draws is made of names that the page leaves behind."""


def notebook(entry: str) -> str:
    """The notebook of a gallery entry as the text of its file, without outputs."""
    page = (GALLERY / f"{entry}.md").read_text(encoding="utf-8")
    page = page.partition("\nThis page [as a notebook]")[0]
    cells, end = [], 0
    for fence in _FENCE.finditer(page):
        cells.append(new_markdown_cell(_prose(page[end : fence.start()])))
        end = fence.end()
        if fence[1] == "python":
            head = f"%%writefile {fence[2]}\n" if fence[2] else ""
            cells.append(new_code_cell(head + fence[3].rstrip("\n")))
    cells.append(new_markdown_cell(_prose(page[end:])))
    cells.append(new_code_cell(DRAWN[entry].rstrip("\n")))
    kept = [cell for cell in cells if cell.source]
    for k, cell in enumerate(kept):
        cell.id = f"{entry}-{k}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    made = new_notebook(cells=kept, metadata={"kernelspec": kernel})
    return str(nbformat.writes(made)) + "\n"


def _prose(text: str) -> str:
    """Links of the page as they are from here."""
    return re.sub(r"\]\((?!\w+:|#|\.\./)", "](../gallery/", text).strip()


if __name__ == "__main__":
    for name in DRAWN:
        (HERE / f"{name}.ipynb").write_text(notebook(name), encoding="utf-8")
