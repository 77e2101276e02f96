"""Pictures of docs/library.md by `result.plot`: `python docs/library_pictures.py`, two minutes."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

from softehl import Mesh, Study  # noqa: E402
from softehl.runtime.results.result import Result  # noqa: E402
from tests.library.structures import pinched_hemisphere, slit_plate  # noqa: E402

PICTURES = HERE / "pictures"


def main() -> None:
    """Draw, cut the white margins off, and save with few colours."""
    study, _ = slit_plate(10, 80)
    results = {"slit_ring": (study.solve(steps=40), "u_z")}
    results["hemisphere"] = pinched_hemisphere(16, 400.0).solve(steps=20), "u_x"
    results["bar"] = twisted_bar(), "von_mises"
    for name, (result, field) in results.items():
        path = PICTURES / f"library_{name}.png"
        result.plot(field, deformed=True, file=path)
        _shrink(path)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def twisted_bar() -> Result:
    """A steel bar that is twisted by a rigid end and yields: von Mises stress."""
    study = Study(Mesh.box(40, 10, 10, cells=(16, 4, 4), order=2))
    study.add("bar", material="hencky_j2", E=210e3, nu=0.3, sy=400, Q=100, b=10, H=500)
    study.fix("left", u_x=0, u_y=0, u_z=0)
    grip = study.rigid("right", at=(40, 5, 5))
    study.fix(grip, u_y=0, u_z=0, theta_y=0, theta_z=0, theta_x=1.0)
    return study.solve(steps=20)


def _shrink(path: Path) -> None:
    with Image.open(path) as picture:
        seen = np.argwhere((np.asarray(picture.convert("RGB")) < 250).any(axis=2))
        (top, left), (bottom, right) = seen.min(axis=0), seen.max(axis=0) + 1
        box = (int(left), int(top), int(right), int(bottom))
        small = picture.convert("RGB").crop(box)
    small.thumbnail((520, 520))
    small.quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
