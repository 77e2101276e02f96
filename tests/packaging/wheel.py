"""Build the sdist and from it the wheel, install that elsewhere, and use it as a stranger would.

    python -m tests.packaging.wheel          (what `make wheel` calls; some minutes, online)

Everything happens in a temporary folder outside the tree.  The commands run with a compiler (some
twice: the first use tunes the kernels) and without one on the PATH; their seconds are shown.  Exit
code 1 and one line for each expectation that is not met.
"""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "docs" / "models" / "gent.py"
REPRODUCE = ("reproduce", "table1")
RUN = ("run", "oring", "--quiet", "--set", "density=1", "--set", "speeds=[400, 100]")
GENERATE = ("generate", "my_model.py")
KERNELS = ("kernels",)
CARRIED = (
    *("tests/packaging/wheel.py", "benchmarks", "docs/conf.py", "CHANGELOG.md"),
    *("CITATION.cff", "CONTRIBUTING.md", "LICENSE", "Makefile"),
)
"""Beside the packages, of which wheels are built from the sdist here."""


class Trial:
    """Commands that are run in a folder, and what was not as it must be."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.wrong: list[str] = []

    def expect(self, holds: bool, message: str) -> None:
        if not holds:
            self.wrong.append(message)
            print(f"NOT AS IT MUST BE: {message}", file=sys.stderr)

    def run(
        self,
        title: str,
        command: Sequence[str],
        *,
        code: int = 0,
        folder: Path | None = None,
        given: Mapping[str, str] | None = None,
    ) -> str:
        """Run a command in `folder` with the variables `given`; what it printed."""
        start = time.perf_counter()
        done = subprocess.run(
            command,
            cwd=folder or self.place,
            env={**_surroundings(), **(given or {})},
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.perf_counter() - start
        shown = " ".join(Path(w).name if w[0] == "/" else w for w in command)
        if "-c" in command:
            shown = title
        print(f"{seconds:7.1f} s  {title}: {shown}", flush=True)
        told = done.stdout + done.stderr
        self.expect(done.returncode == code, f"{shown} ends with {done.returncode}: {told[-2000:]}")
        self.expect("Traceback" not in told, f"{shown} ends in a traceback")
        return told


def _surroundings() -> dict[str, str]:
    """The environment without what would show ours: no PYTHONPATH, no compiler named."""
    hidden = ("PYTHONPATH", "CC", "SOFTEHL_CACHE", "SOFTEHL_KERNELS", "VIRTUAL_ENV")
    return {name: value for name, value in os.environ.items() if name not in hidden}


def main() -> int:
    """Build, install, use."""
    with tempfile.TemporaryDirectory(prefix="softehl-wheel-") as folder:
        trial = Trial(Path(folder).resolve())
        source = _sdist(trial)
        wheel = _wheel(trial, source)
        _wheel_without_compiler(trial, source)
        _check(trial, wheel)
        python = _environment(trial, "environment", str(wheel))
        _use(trial, python, wheel)
        for message in trial.wrong:
            print(f"not as it must be: {message}", file=sys.stderr)
        return 1 if trial.wrong else 0


# ---------------------------------------------------------------------------------------- building


def _sdist(trial: Trial) -> Path:
    """Folder of the unpacked source distribution."""
    copy = trial.place / "tree"
    hidden = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "*.so", "*.sha256")

    def ignored(folder: str, names: list[str]) -> set[str]:
        outputs = {"build", "dist", "results"} if Path(folder) == ROOT else set()
        return {*hidden(folder, names)} | outputs & {*names}

    shutil.copytree(ROOT, copy, symlinks=True, ignore=ignored)
    code = "from setuptools.build_meta import build_sdist; build_sdist('..')"
    trial.run("sdist", [sys.executable, "-c", code], folder=copy)
    shutil.rmtree(copy)
    (archive,) = trial.place.glob("softehl-*.tar.gz")
    shutil.unpack_archive(archive, trial.place / "unpacked", filter="data")
    (source,) = (trial.place / "unpacked").iterdir()
    for name in CARRIED:
        trial.expect((source / name).exists(), f"the sdist has no {name}")
    return source


def _wheel(trial: Trial, source: Path) -> Path:
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-deps"]
    trial.run("wheel", [*pip, "--wheel-dir", "dist", str(source)])
    (wheel,) = (trial.place / "dist").glob("softehl-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    tops = sorted({name.partition("/")[0] for name in names})
    print(f"{wheel.name}: {len(names)} files in {', '.join(tops)}")
    own = [top for top in tops if not top.endswith(".dist-info")]
    trial.expect(own == ["softehl"], f"the wheel installs {', '.join(own)}, must be softehl alone")
    platform = wheel.stem.split("-", 2)[2]
    right = platform.startswith("py3-none-") and not platform.endswith("-any")
    trial.expect(right, f"the wheel is for {platform}, must be for py3-none-PLATFORM")
    wanted = ["kernels.so", "kernels.so.sha256", "solid_q4.c", "softehl_kernels.h", "manifest.json"]
    for name in (*(f"softehl/generated/{n}" for n in wanted), "softehl/py.typed"):
        trial.expect(name in names, f"the wheel has no {name}")
    return wheel


def _wheel_without_compiler(trial: Trial, source: Path) -> None:
    hidden = "import sys; sys.modules['ziglang'] = None"  # the compiler of the slow tests
    code = "from setuptools.build_meta import build_wheel; print(build_wheel('../../plain'))"
    (trial.place / "plain").mkdir()
    (trial.place / "empty").mkdir()
    python = [sys.executable, "-c", f"{hidden}; {code}"]
    empty = str(trial.place / "empty")
    told = trial.run("wheel, no compiler", python, folder=source, given={"PATH": empty})
    words = "THE WHEEL IS BUILT WITHOUT A LIBRARY"
    trial.expect(words in told, "a wheel without a library does not say so")
    found = [p.name for p in (trial.place / "plain").glob("*-py3-none-any.whl")]
    trial.expect(len(found) == 1, "without a compiler there is no wheel for all platforms")


def _check(trial: Trial, wheel: Path) -> None:
    """Metadata and description, as PyPI reads them."""
    commands = _environment(trial, "checking", "twine")
    (archive,) = trial.place.glob("softehl-*.tar.gz")
    trial.run("twine", [str(commands / "twine"), "check", "--strict", str(archive), str(wheel)])


def _environment(trial: Trial, name: str, package: str) -> Path:
    """Folder of the commands of an environment in which a package alone is installed."""
    place = trial.place / name
    venv.create(place, with_pip=True)
    commands = place / "bin"
    pip = [str(commands / "python"), "-m", "pip", "--disable-pip-version-check", "--quiet"]
    trial.run("install", [*pip, "install", package])
    return commands


# ------------------------------------------------------------------------------------------- using


def _use(trial: Trial, commands: Path, wheel: Path) -> None:
    softehl = str(commands / "softehl")
    elsewhere = trial.place / "elsewhere"
    elsewhere.mkdir()
    shutil.copy(MODEL, elsewhere / "my_model.py")
    tuned = {"SOFTEHL_CACHE": str(trial.place / "cache")}
    plain = {"SOFTEHL_CACHE": str(trial.place / "cache-2"), "PATH": str(trial.place / "empty")}

    def use(title: str, *words: str, given: Mapping[str, str], code: int = 0) -> str:
        return trial.run(title, [softehl, *words], given=given, code=code, folder=elsewhere)

    told = use("without SymPy", *GENERATE, code=2, given=tuned)
    hint = "pip install 'softehl[generate]'"
    trial.expect(hint in told and told.count("\n") == 1, f"without SymPy it says {told!r}")
    pip = [str(commands / "python"), "-m", "pip", "--disable-pip-version-check", "--quiet"]
    trial.run("install", [*pip, "install", f"softehl[generate] @ {wheel.as_uri()}"])
    before = _listing(commands.parent)

    told = use("compiler, first", *KERNELS, given=tuned)
    trial.expect("tuned library: " in told, f"with a compiler the library is {told[-300:]!r}")
    use("compiler, again", *KERNELS, given=tuned)
    use("compiler, first", *GENERATE, given=tuned)
    use("compiler, again", *GENERATE, given=tuned)
    use("compiler", *RUN, "--out", "tuned", given=tuned)
    told = use("no compiler", *KERNELS, given=plain)
    trial.expect("plain library " in told, f"without a compiler the library is {told[-300:]!r}")
    told = use("no compiler", *GENERATE, "--out", "other", code=2, given=plain)
    trial.expect(
        "no C compiler" in told and told.count("\n") == 1, f"without a compiler it says {told!r}"
    )
    use("no compiler", *REPRODUCE, "--out", "again", given=plain)
    use("no compiler", *RUN, "--out", "plain", given=plain)
    told = use("regenerate", "generate", code=2, given=tuned)
    trial.expect("generate needs a MODEL.py" in told, f"without a model it says {told!r}")

    changed = _listing(commands.parent).items() ^ before.items()
    trial.expect(not changed, f"the installed files have changed: {sorted(changed)[:5]}")
    apart = _apart(elsewhere / "tuned" / "curve.csv", elsewhere / "plain" / "curve.csv")
    print(f"h*, tuned and plain, are {apart:.1e} apart")
    trial.expect(apart < 1e-9, f"tuned and plain kernels give h* {apart:.1e} apart")


def _listing(place: Path) -> Mapping[str, tuple[int, int]]:
    """Size and time of every installed file but the byte code that Python keeps."""
    found = {}
    for path in place.rglob("*"):
        if path.is_file() and path.suffix != ".pyc":
            status = path.stat()
            found[str(path)] = (status.st_size, status.st_mtime_ns)
    return found


def _apart(first: Path, second: Path) -> float:
    """Largest relative difference of h* between two curves."""
    columns = []
    for path in (first, second):
        with path.open(encoding="utf-8", newline="") as file:
            columns.append([float(row["h_star_um"]) for row in csv.DictReader(file)])
    pairs = zip(columns[0], columns[1], strict=True)
    return max(abs(a - b) / abs(a) for a, b in pairs)


if __name__ == "__main__":
    sys.exit(main())
