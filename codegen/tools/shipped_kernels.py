"""The kernels that ship, compiled for the processor of this machine: `make`, and their first use.

`runtime` runs this as a process of its own and reads the path it prints, so that solving imports
nothing of the compiler.
"""

from __future__ import annotations

import sys
from pathlib import Path

from softehl.codegen.abi import BuildError, NoCompilerError
from softehl.codegen.tools import build, kernel_cache
from softehl.codegen.tools.cache_dir import CacheError

FAILED, NO_COMPILER = 2, 3


def folder() -> Path:
    """Their folder in the user's cache, filled if need be.

    Raises `BuildError`, `CacheError`, and OSError where the disk is full.
    """
    files = {p.name: p.read_text(encoding="utf-8") for p in build.GENERATED.glob("*.[ch]")}
    return kernel_cache.compiled(files, keep=True)[0]


def main() -> int:
    """Print the path of the library, or one line with the reason why there is none."""
    try:
        print(folder() / build.LIBRARY)
    except NoCompilerError as error:
        return _failed(error, NO_COMPILER)
    except (BuildError, CacheError) as error:
        return _failed(error, FAILED)
    except OSError as error:
        print(f"softehl: cannot write {error.filename}: {error.strerror or error}", file=sys.stderr)
        return FAILED
    return 0


def _failed(error: Exception, code: int) -> int:
    print(f"softehl: {error}", file=sys.stderr)
    return code
