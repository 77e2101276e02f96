"""Compile the generated C into one shared library (no SymPy needed).

`python -m softehl.codegen.tools.build` is what `make` calls.  The library carries the signature
of the sources
it was built from; it is written under a temporary name and moved into place, so that two builds
at once do no harm.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

GENERATED = Path(__file__).resolve().parents[2] / "generated"
FLAGS = (
    "-std=c11",
    "-O2",
    "-march=native",
    "-fno-math-errno",
    "-ffp-contract=fast",
    "-fPIC",
    "-shared",
)
STRICT = ("-Wall", "-Wextra", "-Werror")
LIBRARY = "kernels" + (sysconfig.get_config_var("SHLIB_SUFFIX") or ".so")


class BuildError(RuntimeError):
    """The compiler failed or is missing; the message holds its command line and its words."""


def signature(directory: Path) -> str:
    """Signature of the C sources and header in a directory."""
    digest = hashlib.sha256()
    for path in sorted(directory.glob("*.[ch]")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def compiler() -> list[str]:
    """The C compiler as a command: $CC, or cc from the PATH."""
    return shlex.split(os.environ.get("CC") or "cc")


def build(directory: Path = GENERATED, *, extra: Sequence[str] = STRICT) -> Path:
    """Compile every C file of `directory` into its shared library and return its path."""
    sources = sorted(str(p) for p in directory.glob("*.c"))
    target = directory / LIBRARY
    handle, scratch = tempfile.mkstemp(suffix=".so", dir=directory)
    os.close(handle)
    define = f'-DSOFTEHL_SIGNATURE="{signature(directory)}"'
    command = [*compiler(), *FLAGS, *extra, define, *sources, "-o", scratch, "-lm"]
    try:
        _run(command)
        os.replace(scratch, target)
    finally:
        Path(scratch).unlink(missing_ok=True)
    return target


def build_each(directory: Path) -> dict[str, float]:
    """Like `build`, one C file after another; returns the seconds that each took, by its stem.

    Warnings are no errors here: a newer compiler may warn of what ours does not.
    """
    seconds = {}
    define = f'-DSOFTEHL_SIGNATURE="{signature(directory)}"'
    with tempfile.TemporaryDirectory(prefix=".part-", dir=directory) as scratch:
        objects = []
        for source in sorted(directory.glob("*.c")):
            objects.append(str(Path(scratch) / f"{source.stem}.o"))
            compiling = [f for f in FLAGS if f != "-shared"]
            start = perf_counter()
            _run([*compiler(), *compiling, define, "-c", str(source), "-o", objects[-1]])
            seconds[source.stem] = perf_counter() - start
        _run([*compiler(), *FLAGS, *objects, "-o", str(directory / LIBRARY), "-lm"])
    return seconds


def identification() -> str:
    """What the compiler says of itself, the flags and the processor they compile for.

    Its predefined macros hold all of that, the instruction set of -march=native included.
    """
    command = [*compiler(), *(f for f in FLAGS if f != "-shared"), "-dM", "-E", "-x", "c", "-"]
    return shlex.join([*compiler(), *FLAGS]) + "\n" + _run(command)


def _run(command: Sequence[str]) -> str:
    line = shlex.join(command)
    if shutil.which(command[0]) is None:
        raise BuildError(
            f"no C compiler: {command[0]!r} is not on the PATH; install one or set CC\n  {line}"
        )
    result = subprocess.run(command, capture_output=True, text=True, check=False, input="")
    if result.returncode != 0:
        raise BuildError(f"the C compiler failed ({result.returncode}):\n  {line}\n{result.stderr}")
    return result.stdout


def main() -> int:
    """Build the kernels that ship."""
    try:
        print(f"built {build()}")
    except BuildError as error:
        print(f"softehl: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
