"""Command `softehl generate --target`: the C of another target, in a separate folder.

`generated/` holds target `simd` only, so that what is checked in has one meaning.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from softehl.codegen import pipeline
from softehl.codegen.abi import Target, TargetError
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import cache_store, output_files


def write(definitions: Iterable[Definition], target: Target, folder: Path | None) -> int:
    """Write all files of a target into `folder`; the exit code.

    A family that the target cannot hold is named and left out.
    """
    if folder is None:
        print(
            f"softehl: generated/ holds target simd only, give --out FOLDER for target {target}",
            file=sys.stderr,
        )
        return 2
    kernels = []
    for d in definitions:
        try:
            kernels.append(pipeline.compile_model(d, target))
        except TargetError as error:
            print(f"left out: {error}", file=sys.stderr)
    files = (
        output_files.ufcx_files(kernels) if target is Target.UFCX else output_files.files(kernels)
    )
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        cache_store.write(folder / name, text.encode())
    print(f"files of target {target} in {folder}: {len(files)}")
    return 0
