"""What pyproject.toml cannot say: a wheel carries a library of its kernels for a plain processor.

The library is no Python extension, so one wheel of a platform serves every Python 3.  Where there
is no working C compiler the wheel is built without it, for all platforms.  An editable install
compiles nothing: its kernels are tuned at their first use.
"""

import platform
import shutil
import signal
import sys
import tempfile
import tomllib
from functools import cache
from pathlib import Path

import setuptools
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "src"))

from softehl.codegen.tools import build  # noqa: E402

COMPILED = (build.LIBRARY, build.DIGEST)
SCRATCH = tempfile.TemporaryDirectory(prefix="softehl-build-")


def packages() -> list[str]:
    """All packages, by the folders that package-dir of pyproject.toml names."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))
    found = ["softehl"]
    for name, folder in project["tool"]["setuptools"]["package-dir"].items():
        if name:
            inside = setuptools.find_packages(str(HERE / folder))
            found += [name, *(f"{name}.{package}" for package in inside)]
    return found


@cache
def plain_library() -> Path | None:
    """A temporary folder with the plain library; None where there is no working compiler."""
    folder = Path(SCRATCH.name)
    for source in build.GENERATED.glob("*.[ch]"):
        shutil.copy(source, folder)
    try:
        build.build_plain(folder)
    except build.BuildError as error:
        print(f"softehl: {error}", file=sys.stderr)
        print(
            "softehl: THE WHEEL IS BUILT WITHOUT A LIBRARY OF ITS KERNELS: where it is installed, "
            "they are compiled at their first use, which needs a C compiler there",
            file=sys.stderr,
        )
        return None
    return folder


class Distribution(setuptools.Distribution):
    """Knows whether this build is for one platform."""

    def has_ext_modules(self) -> bool:
        return "bdist_wheel" in self.commands and plain_library() is not None


class BuildPackage(build_py):
    """Adds the library to the built package."""

    def run(self) -> None:
        super().run()
        folder = plain_library() if self.distribution.has_ext_modules() else None
        if folder is not None and not self.editable_mode:
            for name in COMPILED:
                self.copy_file(str(folder / name), str(self._place(name)))

    def _place(self, name: str) -> Path:
        return Path(self.build_lib) / "softehl" / "generated" / name

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        added = COMPILED if self.distribution.has_ext_modules() else ()
        return [*super().get_outputs(include_bytecode), *(str(self._place(n)) for n in added)]


class Wheel(bdist_wheel):
    """Depends on the platform, not on the version of Python."""

    def get_tag(self) -> tuple[str, str, str]:
        tag = super().get_tag()
        if self.root_is_pure:
            return tag
        # the library is for the processor at hand, also where Python is for two
        return "py3", "none", tag[2].replace("universal2", platform.machine())


signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # ends by way of the `with`
with SCRATCH:
    setuptools.setup(
        packages=packages(),
        distclass=Distribution,
        cmdclass={"build_py": BuildPackage, "bdist_wheel": Wheel},
    )
