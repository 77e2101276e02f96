"""Device kernels of a page for the runtime: their text, and their library for the processor."""

from __future__ import annotations

import hashlib
import os
import re
from pathlib import Path

from softehl.codegen import pipeline
from softehl.codegen.abi import BuildError
from softehl.codegen.c_compiler import CXX, called, compiler, supported
from softehl.codegen.emit.device import header
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import cache_dir
from softehl.codegen.tools.page_evaluation import definition_of
from softehl.device_source import DeviceSource, NodalFields

FLAGS = ("-O2", "-march=native", "-std=c++17", "-shared", "-fPIC", "-w")


def source_of(folder: Path, kernel: str, real: str = "double") -> DeviceSource:
    """Device kernels of a kernel of a library.  Raises `TargetError`, `ModelFileError`."""
    return device_source(definition_of(folder, kernel), real)


def device_source(definition: Definition, real: str = "double") -> DeviceSource:
    """Device kernels of a page on a kind of cell.  Raises `TargetError`."""
    kernels = pipeline.device_kernels(definition)
    text = kernels.text(real)
    signatures = re.findall(r"^KERNEL(?:_LARGE)?\((\w+), \d+, int n, (.*)\)$", text, re.MULTILINE)
    return DeviceSource(
        name=definition.name,
        files={
            f"{definition.name}.cu": text,
            header.NAME: header.TEXT,
            header.FIBERS: header.FIBERS_TEXT,
        },
        elements=kernels.elements,
        threads=kernels.threads,
        dimension=kernels.D,
        fields=tuple(
            NodalFields(tuple(c.name for c in kernels.components[f.first : f.last]), f.order)
            for f in kernels.fields
        ),
        line=kernels.q,
        geometry=len(kernels.kept),
        moduli=kernels.parent.size,
        history=len(definition.point_data),
        symmetric=kernels.symmetric,
        orders=tuple(kernels.orders),
        kernels={name: arguments.count("*") for name, arguments in signatures},
        routines=any(routines for _, _, routines in kernels.parts.values()),
        real="float32" if real == "float" else "float64",
    )


def emulated_library(source: DeviceSource, fibers: bool = False) -> Path:
    """The kernels compiled as C++, from the cache.  Raises `BuildError`."""
    found = compiler(CXX)
    command = [*found, *supported(found, FLAGS), *(["-DSOFTEHL_FIBERS"] if fibers else [])]
    digest = hashlib.sha256("\0".join([*source.files.values(), *command]).encode()).hexdigest()
    folder = cache_dir.root() / "device" / digest[:32]
    library = folder / "kernels.so"
    if library.is_file():
        return library
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in source.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    made = folder / f"kernels-{os.getpid()}.so"
    command += ["-x", "c++", str(folder / next(iter(source.files))), "-o", str(made)]
    done = called(command, CXX)
    if done.returncode:
        raise BuildError(f"{' '.join(command)} failed: {done.stderr.strip()[:2000]}")
    made.replace(library)
    return library
