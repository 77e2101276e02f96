"""`softehl sweep --mpi` on the processes of mpiexec."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cases.test_sweep import GRID, swept
from tests.mpi.test_engine import mpiexec

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(importlib.util.find_spec("mpi4py") is None, reason="no mpi4py"),
]


def test_mpi_gives_the_same_table(tmp_path: Path) -> None:
    assert swept(tmp_path / "s.toml", GRID) == 0
    script = ["mpi4py.futures", "-m", "softehl", "sweep", str(tmp_path / "s.toml")]
    command = [*mpiexec(3), sys.executable, "-m", *script, "--mpi", "--out", str(tmp_path / "mpi")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr
    assert "6 converged" in done.stdout
    table = (tmp_path / "mpi" / "sweep.csv").read_text()
    assert table == (tmp_path / "s" / "sweep.csv").read_text()
