"""Compile generated C into one shared library (no SymPy needed).

`build` fills one folder: the library carries the signature of the sources that it was built from,
and its SHA-256 stands beside it, so that a damaged one is never loaded.  Both are written under
temporary names and moved into place: two builds at once do no harm.

`python -m softehl.codegen.tools.build` compiles the kernels that ship, for the processor of this
machine, into the user's cache and prints where they are. The runtime reads the path, so that
solving imports nothing of the compiler.
"""

from __future__ import annotations

import hashlib
import platform
import shlex
import shutil
import sys
import sysconfig
import tempfile
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter

from softehl.codegen.abi import VERSION, BuildError, NoCompilerError
from softehl.codegen.c_compiler import called, compiler, is_zig, supported
from softehl.codegen.emit import c_runtime
from softehl.codegen.tools import cache_store
from softehl.system import processors

GENERATED = Path(__file__).resolve().parents[2] / "generated"
_FAILED, _NO_COMPILER = 2, 3
"""Exit codes of `main`."""
COMMON = (
    *("-std=c11", "-O2", "-fno-math-errno", "-ffp-contract=fast", "-fPIC", "-shared"),
    *("-fno-tree-pre", "-Wno-ignored-optimization-argument"),
)
"""What leaves a loop, the generator has taken out; what GCC adds to it costs registers (clang has
no such option, and would say so): without it hex8 is 1.2 times faster, Q4 with a branch 1.25.
"""
FLAGS = (*COMMON, "-march=native")
"""For the processor of this machine."""
PLAIN = (*COMMON, *(["-march=x86-64"] if platform.machine() in ("x86_64", "AMD64") else []))
"""For every processor of this platform: what a wheel carries."""
WIDE = ("solid_q4", "solid_fbar", "solid_taylor", "solid_taylor_mean")
"""Kernels of which the plain library for x86-64 computes several elements at once: that takes 0.6
to 0.7 of the time there. A vector of four is two registers without AVX, and the other kernels are
faster one at a time (films 1.7 to 7 times, contact 1.3 to 12 times, other rubbers within 4 %) and
compile in a quarter of the time.
"""
LARGE, LIGHT = 20_000, "-O1"
"""Operations in a file above which more than -O1 costs minutes, and the code gets slower."""
SHARED_LARGE = 2_500
SHARED_LIGHT = (LIGHT, "-fschedule-insns2", "-fgcse", "-fpeephole2")
"""The same for loops that models share: hex27 takes half the time to compile and 1 % more to run;
hex8 (1900 operations) would take 4 % more."""
OPERATORS = (" + ", " - ", " * ", " / ")
STRICT = ("-Wall", "-Wextra", "-Werror")
"""For our own tests alone: another compiler may warn of what ours does not."""
SHARED = "pairs_"
"""Beginning of the names of sources that know nothing of the model and are compiled once."""
_OBJECT, _SUM = "shared.o", "shared.o.sha256"
LIBRARY = "kernels" + (sysconfig.get_config_var("SHLIB_SUFFIX") or ".so")
DIGEST = f"{LIBRARY}.sha256"


def signature(directory: Path) -> str:
    """Signature of the C sources and header in a directory."""
    digest = hashlib.sha256()
    for path in sorted(directory.glob("*.[ch]")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def is_intact(directory: Path) -> bool:
    """True if the library is undamaged and built from the sources beside it; never loads it."""
    try:
        data = (directory / LIBRARY).read_bytes()
        recorded = (directory / DIGEST).read_text(encoding="ascii").split()
        return recorded[:1] == [_sha256(data)] and signature(directory).encode() in data
    except (OSError, UnicodeDecodeError):
        return False


def extra_flags(source: Path, text: str) -> tuple[str, ...]:
    """Flags after all others for a file of C with many operations."""
    operations = sum(map(text.count, OPERATORS))
    if source.name.startswith(SHARED):
        return SHARED_LIGHT if operations > SHARED_LARGE else ()
    return (LIGHT,) if operations > LARGE else ()


def build(
    directory: Path,
    *,
    flags: Sequence[str] = FLAGS,
    extra: Sequence[str] = (),
    wide: Collection[str] | None = None,
) -> dict[str, float]:
    """Compile every C file of `directory` into its shared library.

    wide: names of the files that compute several elements at once; all that can, if left out.
    Returns the seconds that each file took, by its stem.  An older library stays if anything fails.
    """
    define = f'-DSOFTEHL_SIGNATURE="{signature(directory)}"'
    sources = sorted(
        directory.glob("*.c"), key=lambda path: -path.stat().st_size
    )  # long ones first
    command = compiler()
    with tempfile.TemporaryDirectory(prefix=".part-", dir=directory) as scratch:
        objects = [Path(scratch) / f"{source.stem}.o" for source in sources]
        compiling = [flag for flag in flags if flag != "-shared"]

        def compiled(source: Path, to: Path) -> float:
            start = perf_counter()
            text = source.read_text(encoding="utf-8")
            lanes = [] if wide is None or source.stem in wide else ["-DSOFTEHL_LANES=1"]
            all_flags = [*compiling, *extra_flags(source, text), *lanes, *extra]
            arguments = [*command, *supported(command, all_flags)]
            if source.name.startswith(SHARED):
                shutil.copyfile(_shared(source, text, arguments, flags), to)
            else:
                _run([*arguments, define, "-c", str(source), "-o", str(to)], to)
            return perf_counter() - start

        with ThreadPoolExecutor(processors()) as pool:
            seconds = list(pool.map(compiled, sources, objects))
        linked = Path(scratch) / LIBRARY
        linking = [*command, *supported(command, [*flags, *extra])]
        _run([*linking, *map(str, objects), "-o", str(linked), "-lm"], linked)
        data = linked.read_bytes()
    cache_store.write(directory / LIBRARY, data, mode=0o755)
    cache_store.write(directory / DIGEST, f"{_sha256(data)}  {LIBRARY}\n".encode(), mode=0o644)
    return {source.stem: s for source, s in zip(sources, seconds, strict=True)}


def build_plain(directory: Path) -> dict[str, float]:
    """Compile the kernels that ship, in `directory`, for every processor of this platform."""
    x86 = "-march=x86-64" in PLAIN
    return build(directory, flags=PLAIN, wide=WIDE if x86 else None)


def _shared(source: Path, text: str, command: Sequence[str], flags: Sequence[str]) -> Path:
    """Object file of a source that many folders hold, compiled once in the user's cache.

    It knows of the header only what is the same in all of them.
    """
    inputs = (text, c_runtime.TEXT, str(VERSION), shlex.join(command), identification(flags))
    key = cache_store.digest(["shared", *inputs])

    def complete(folder: Path) -> bool:
        data = (folder / _OBJECT).read_bytes()
        return (folder / _SUM).read_text(encoding="ascii") == _sha256(data)

    def make(folder: Path) -> None:
        to = folder / _OBJECT
        _run([*command, "-c", str(source), "-o", str(to)], to)
        cache_store.write(folder / _SUM, _sha256(to.read_bytes()).encode())

    return cache_store.folder(key, complete, make) / _OBJECT


def tuned_flags() -> tuple[tuple[str, ...], str]:
    """Flags for this processor if the compiler supports it, and its `identification`.

    The gcc of MinGW does not: it may store vectors of AVX where they are not aligned.
    """
    try:
        tuned = identification(FLAGS)
    except NoCompilerError:
        raise
    except BuildError:
        return PLAIN, identification(PLAIN)
    macros = macros_of(tuned)
    if "__MINGW32__" in macros and "__clang__" not in macros:
        return PLAIN, identification(PLAIN)
    return FLAGS, tuned


def identification(flags: Sequence[str] = FLAGS) -> str:
    """Identification of the compiler, the flags and the processor they compile for.

    Its predefined macros hold all of that, the instruction set of -march=native included.
    """
    command = compiler()
    accepted = supported(command, [f for f in flags if f != "-shared"])
    done = called([*command, *accepted, "-dM", "-E", "-x", "c", "-"])
    if done.returncode != 0 or "#define __STDC__" not in done.stdout:
        message = " ".join((done.stderr or done.stdout).split())[:200] or "nothing"
        raise BuildError(
            f"{shlex.join(command)} does not answer as a C compiler does "
            f"(exit code {done.returncode}: {message}): set CC to one"
        )
    return shlex.join([*command, *flags]) + "\n" + done.stdout


def macros_of(identified: str) -> dict[str, str]:
    """Values of predefined macros by name, of an `identification`."""
    lines = (line.split(maxsplit=2) for line in identified.splitlines()[1:])
    return {fields[1]: fields[2] if len(fields) > 2 else "" for fields in lines if len(fields) > 1}


def compiler_name() -> str:
    """Kind, version and command of the compiler, for people.  Raises BuildError."""
    macros = macros_of(tuned_flags()[1])
    version = macros.get("__VERSION__", "").strip('"')
    kind = "" if "__clang__" in macros or "__GNUC__" not in macros else "gcc "
    command = compiler()
    package = ", package ziglang" if is_zig(command) else ""
    return f"{kind}{version}{package}: {shlex.join(command)}"


def _run(command: Sequence[str], makes: Path) -> None:
    done = called(command)
    line = shlex.join(command)
    if done.returncode != 0:
        raise BuildError(f"the C compiler failed ({done.returncode}):\n  {line}\n{done.stderr}")
    if not makes.is_file():
        raise BuildError(
            f"{command[0]} is no C compiler (it wrote nothing): set CC to one\n  {line}"
        )


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def main() -> int:
    """Compile the kernels that ship; print the path of the library, or one line why there is none.

    2: it failed. 3: there is no compiler.
    """
    from softehl.codegen.tools import kernel_cache
    from softehl.codegen.tools.cache_dir import CacheError

    try:
        files = {p.name: p.read_text(encoding="utf-8") for p in GENERATED.glob("*.[ch]")}
        print(kernel_cache.compiled(files, keep=True)[0] / LIBRARY)
    except NoCompilerError as error:
        return _failed(f"{error}", _NO_COMPILER)
    except (BuildError, CacheError) as error:
        return _failed(f"{error}", _FAILED)
    except OSError as error:
        return _failed(f"cannot write {error.filename}: {error.strerror or error}", _FAILED)
    return 0


def _failed(reason: str, code: int) -> int:
    print(f"softehl: {reason}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
