"""Device kernels by NVRTC and ptxas of wheels: registers, memory that is spilled, shared memory.

pip install nvidia-cuda-nvrtc-cu12 nvidia-cuda-nvcc-cu12; no GPU is needed.
"""

from __future__ import annotations

import ctypes
import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

from softehl.codegen.tools.device_library import device_source
from softehl.device_source import DeviceSource
from softehl.runtime.device.device_module import OPTIONS
from tests.device.test_device_kernels import page


def package(name: str) -> Path | None:
    """Folder of a package of NVIDIA."""
    try:
        found = importlib.util.find_spec(f"nvidia.{name}")
    except ModuleNotFoundError:
        return None
    places = list(found.submodule_search_locations or ()) if found else []
    return Path(places[0]) if places else None


NVRTC, NVCC = package("cuda_nvrtc"), package("cuda_nvcc")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(NVRTC is None or NVCC is None, reason="no wheels of NVRTC and ptxas"),
]


def ptx(source: DeviceSource, architecture: str) -> bytes:
    """PTX of a text; its log where it cannot be compiled."""
    assert NVRTC is not None
    library = ctypes.CDLL(str(next((NVRTC / "lib").glob("libnvrtc.so.*"))))
    program, size = ctypes.c_void_p(), ctypes.c_size_t()
    text = source.joined.encode()
    assert not library.nvrtcCreateProgram(ctypes.byref(program), text, b"k.cu", 0, None, None)
    options = [f"--gpu-architecture=compute_{architecture}".encode(), *map(str.encode, OPTIONS)]
    code = library.nvrtcCompileProgram(
        program, len(options), (ctypes.c_char_p * len(options))(*options)
    )
    kind = "ProgramLog" if code else "PTX"
    getattr(library, f"nvrtcGet{kind}Size")(program, ctypes.byref(size))
    result = ctypes.create_string_buffer(size.value)
    getattr(library, f"nvrtcGet{kind}")(program, result)
    assert code == 0, result.value.decode()[:2000]
    return result.value


def figures(source: DeviceSource, architecture: str, place: Path) -> dict[str, dict[str, int]]:
    """Bytes spilled, registers and bytes of shared memory of every kernel."""
    file = place / "kernels.ptx"
    file.write_bytes(ptx(source, architecture))
    command = [str(NVCC) + "/bin/ptxas", f"-arch=sm_{architecture}", "-v", str(file)]
    done = subprocess.run(
        [*command, "-o", str(place / "kernels.cubin")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[:2000]
    found = {}
    for part in re.split(r"Compiling entry function '", done.stderr)[1:]:
        numbers = {
            "spilled": r"(\d+) bytes spill stores",
            "registers": r"Used (\d+) registers",
            "shared": r"(\d+) bytes smem",
        }
        matches = {name: re.search(pattern, part) for name, pattern in numbers.items()}
        found[part.split("'")[0]] = {n: int(m[1]) if m else 0 for n, m in matches.items()}
    return found


@pytest.mark.parametrize("architecture", ["80", "90"])
@pytest.mark.parametrize("cell", ["hex8", "hex27", "hex64", "hex125"])
def test_nothing_is_spilled(cell: str, architecture: str, tmp_path: Path) -> None:
    source = device_source(page("neo_hooke").definition(cell))
    found = figures(source, architecture, tmp_path)
    assert set(found) == set(source.kernels)
    for kernel in (
        "residual",
        "geometry",
        "product",
        "product_geometry",
        "product_moduli",
        "diagonal",
    ):
        assert found[kernel]["spilled"] == 0, found
    assert max(f["shared"] for f in found.values()) < 48 * 1024, found


@pytest.mark.parametrize(
    ("law", "cell"),
    [("plastic", "hex8"), ("viscous", "hex8"), ("advection", "quad9"), ("mixed", "hex27")],
)
def test_other_laws_are_compiled(law: str, cell: str, tmp_path: Path) -> None:
    found = figures(device_source(page(law).definition(cell)), "90", tmp_path)
    assert all(0 < f["registers"] <= 255 for f in found.values()), found
