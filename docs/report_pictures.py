"""Reports of docs/first-seal.md as a browser shows them: `make pictures`, where there is Chromium.

Five runs (a minute or two), four reports. Wanted: Chromium and its driver (Debian: chromium,
chromium-driver) and selenium, which the extra `dev` brings.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

import softehl

WIDTH, HEIGHT = 1040, 9000
"""Of the window, pixels: a whole report."""
SHOWN = 660
"""Width of a picture, pixels."""
_BROWSERS = ("chromium", "google-chrome")

_RING = ("ring=AS568-210", "rod=19")
_FEW = ("speeds=[800, 200]", "error_estimate=false")
_OTHER = ("housing_diameter=56.4", "sealed_pressure=10 bar", *_FEW)
_ROD = (*_RING, "shore_A=90", "sealed_pressure=10 MPa", *_FEW)
_PARTS = """
return [...document.querySelectorAll('section')].map(part => {
    const place = part.getBoundingClientRect();
    return [part.querySelector('h2').innerText, place.top, place.bottom];
})
"""
RUNS = {
    "o_ring": (*_RING, "shore_A=70", "sealed_pressure=30 bar"),
    "x_ring": (*_OTHER, "section=x_ring", "groove_width=4.3"),
    "u_cup": (*_OTHER, "section=u_cup", "groove_width=6"),
    "smooth": _ROD,
    "rough": (*_ROD, "roughness=0.2"),
}
"""The designs of docs/first-seal.md."""


@dataclass(frozen=True)
class Shot:
    """A picture: the report of some runs, from the heading `first` to the end of that of `last`."""

    name: str
    runs: tuple[str, ...]
    first: str
    last: str


SHOTS = (
    Shot("report", ("o_ring",), "", "Film thickness"),
    Shot("report_x_ring", ("x_ring",), "Deformed section", "Film and pressure"),
    Shot("report_u_cup", ("u_cup",), "Deformed section", "Film and pressure"),
    Shot("report_two", ("smooth", "rough"), "Side by side", "Side by side"),
)


def main(folder: Path) -> None:
    """Write every picture into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place, browser() as driver:
        for name, keys in RUNS.items():
            out = ("--quiet", "--out", f"{place}/{name}")
            run("run", "oring", *out, *(f"--set={key}" for key in keys))
        for shot in SHOTS:
            page = Path(place, f"{shot.name}.html")
            run("report", *(f"{place}/{name}" for name in shot.runs), "--out", str(page))
            driver.get(page.as_uri())
            driver.execute_async_script("setTimeout(arguments[0], 2000)")  # curves are drawn
            save(driver.get_screenshot_as_png(), edges(driver, shot), folder / f"{shot.name}.png")


def run(*arguments: str) -> None:
    """A command that has to end well."""
    code = softehl.main(arguments)
    if code:
        raise SystemExit(code)


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    from selenium import webdriver

    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    driver = shutil.which("chromedriver")
    if found is None or driver is None:
        raise SystemExit("no Chromium with its driver: install chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = found
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
        options.add_argument(argument)
    options.add_argument(f"--window-size={WIDTH},{HEIGHT}")
    chromium = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield chromium
    finally:
        chromium.quit()


def edges(driver: Any, shot: Shot) -> Sequence[float]:
    """Beginning and end of a picture on the page, pixels."""
    found = driver.execute_script(_PARTS)
    parts = {title: (top, bottom) for title, top, bottom in found}
    return parts[shot.first][0] if shot.first else 0.0, parts[shot.last][1] + 16.0


def save(picture: bytes, shown: Sequence[float], to: Path) -> None:
    """A part of a page, smaller and with a palette."""
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    top, bottom = shown
    image = image.crop((0, int(top), image.width, int(bottom)))
    image = image.resize(
        (SHOWN, round(image.height * SHOWN / image.width)), Image.Resampling.LANCZOS
    )
    image.quantize(128).save(to, "PNG", optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures"))
