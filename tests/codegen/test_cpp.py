"""The generated header is C++ as well."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import cffi
import pytest

from softehl.codegen import abi
from softehl.codegen.elements import quadrature
from softehl.codegen.emit import c_source
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build
from tests.codegen.workshop import compiled

CALLER = """
#include <cstdio>
#include <vector>
#include "softehl_kernels.h"

int main()
{
    const std::vector<double> dofs{3.0}, parameters{2.0}, rule{1.0};
    std::vector<double> force(1), tangent(1);
    softehl_spring_tangent(1, 1, 0, nullptr, dofs.data(), nullptr, parameters.data(), nullptr,
        rule.data(), nullptr, force.data(), tangent.data());
    std::printf("%g %g %d\\n", force[0], tangent[0], softehl_signature() != nullptr);
}
"""


def test_a_kernel_is_called_from_cpp(tmp_path: Path) -> None:
    if shutil.which("g++") is None:
        pytest.skip("no C++ compiler")
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    (k,) = m.parameters(k="stiffness [N/mm]")
    m.potential(k / 2 * x**2)
    compiled(m.finish(), tmp_path, "-O0")
    (tmp_path / "caller.cpp").write_text(CALLER)
    strict = (*build.STRICT, "-Wpedantic", "-std=c++17")
    command = ["g++", *strict, "caller.cpp", build.LIBRARY, "-Wl,-rpath,$ORIGIN", "-o", "caller"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "caller"], capture_output=True, text=True, check=True)
    assert done.stdout == "6 2 1\n"


def test_cffi_reads_the_prototypes() -> None:
    text = c_source.header([abi.function_name("spring", "energy")])
    kind = text[text.index("typedef void softehl_kernel") : text.index("#if !defined(__cplusplus)")]
    prototypes = text[
        text.index("softehl_kernel softehl") : text.rindex("#if defined(__cplusplus)")
    ]
    cffi.FFI().cdef(kind + prototypes)
