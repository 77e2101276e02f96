"""Command `softehl generate`: errors are one line on stderr, with exit code 2."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from softehl.codegen import pipeline
from softehl.codegen.abi import BuildError, Target
from softehl.codegen.elements import cells
from softehl.codegen.hosts import registry
from softehl.codegen.language.material import Law
from softehl.codegen.language.weak_form import DEFAULT_CELL, CellOptions
from softehl.codegen.models import ALL
from softehl.codegen.tools import cache_store, host_files, model_loader, output_files, target_files
from softehl.codegen.tools import user_kernels as cli_files
from softehl.codegen.tools.build import GENERATED
from softehl.codegen.tools.cache_dir import CacheError
from softehl.codegen.tools.model_text import ModelFileError
from softehl.codegen.tools.trace import show as show_trace
from softehl.codegen.verify.random_states import NoStateError
from softehl.codegen.verify.verification import SECONDS

CHECKOUT = (GENERATED.parent / "pyproject.toml").exists()
"""Whether this is a source checkout: what is installed is never written to."""


def generate(
    models: Sequence[Path] = (),
    check: bool = False,
    trace: str | None = None,
    target: str = Target.SIMD,
    out: Path | None = None,
    seconds: float = SECONDS,
    on: CellOptions = DEFAULT_CELL,
) -> int:
    """Generate kernels; `softehl generate`.

    Parameters
    ----------
    models : sequence of Path
        Model files; without them the kernels that ship.
    check : bool
        Write nothing, and return 1 if a file is out of date.
    trace : str, optional
        Kernel to show before and after each pass.
    target : str
        "simd", "scalar", or the name of a host.
    out : Path, optional
        Folder of the files.
    seconds : float
        Time limit for the check of each kernel [s].
    on : CellOptions
        Cells and geometry of weak forms.

    Returns
    -------
    int
        Exit code; 2 after an error, which is one line on stderr.
    """
    try:
        _require_printable([*models, *([out] if out else [])])
        if target in registry.targets() and (target != Target.UFCX or _materials(models, on)):
            if check or trace is not None:
                return _refused(f"--check and --trace know target simd, not {target}")
            return host_files.generate(models, target, out, on)
        return _generate(
            models,
            check=check,
            trace=trace,
            target=Target(target),
            out=out,
            seconds=seconds,
            on=on,
        )
    except (ModelFileError, NoStateError, BuildError, CacheError) as error:
        return _refused(str(error))
    except OSError as error:
        return _refused(f"cannot write {error.filename}: {error.strerror or error}")


def _materials(models: Sequence[Path], on: CellOptions) -> bool:
    """True for files of materials alone: target ufcx writes them otherwise than elements."""
    pages = [] if on.cells else [d for path in models for d in model_loader.pages(path, on)]
    return bool(pages) and all(isinstance(d, Law) for d in pages)


def _require_printable(paths: Sequence[Path]) -> None:
    for path in paths:
        try:
            str(path).encode()
        except UnicodeEncodeError:
            raise ModelFileError(f"the name {str(path)!a} is not UTF-8: rename it") from None


def _refused(message: str) -> int:
    print(f"softehl: {message}", file=sys.stderr)
    return 2


def _generate(
    models: Sequence[Path],
    *,
    check: bool,
    trace: str | None,
    target: Target,
    out: Path | None,
    seconds: float,
    on: CellOptions,
) -> int:
    """Regenerate `generated/`; with `check` write nothing and name what is stale (exit code 1).

    With `models` do the same for the files of a user, as `codegen.tools.user_kernels` says.
    Another `target` than simd is only written, into the folder `out`.
    """
    if target != Target.SIMD:
        if check or trace is not None:
            return _refused(f"--check and --trace know target simd, not {target}")
        if models:
            return cli_files.write_target(models, target, out, on)
        return target_files.write((make() for make in ALL.values()), target, out)
    if models:
        return cli_files.generate(models, out=out, check=check, trace=trace, seconds=seconds, on=on)
    if out is not None:
        return _refused("--out needs a MODEL.py or a --target")
    if trace is not None:
        return _trace(trace)
    if not (check or CHECKOUT):
        return _refused("generate needs a MODEL.py: the kernels of an installed softehl stay as is")
    return _regenerate(check)


def _regenerate(check: bool) -> int:
    files = output_files.files(pipeline.compile_model(make()) for make in ALL.values())
    files[cells.CELL_TABLE] = cells.cell_table()
    stale = [name for name, text in files.items() if _differs(GENERATED / name, text)]
    expected = {*files, "__init__.py"}
    unexpected = [p.name for p in GENERATED.glob("*.[chj]*") if p.name not in expected]
    if check:
        for name in stale + unexpected:
            print(f"stale: generated/{name}", file=sys.stderr)
        if stale or unexpected:
            print("mend it with: softehl generate", file=sys.stderr)
        return 1 if stale or unexpected else 0
    GENERATED.mkdir(exist_ok=True)
    for name in unexpected:
        (GENERATED / name).unlink()
    for name in stale:
        cache_store.write(GENERATED / name, files[name].encode())
    print(f"{len(files)} files in generated/, {len(stale)} of them new or changed")
    return 0


def _differs(path: Path, text: str) -> bool:
    return not path.exists() or path.read_text(encoding="utf-8") != text


def _trace(family: str) -> int:
    if family not in ALL:
        return _refused(f"no model {family!r}; there are {', '.join(ALL)}")
    show_trace(ALL[family]())
    return 0
