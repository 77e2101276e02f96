"""A checkout without symbolic links, as of Windows or of `git clone -c core.symlinks=false`."""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import setuptools

ROOT = Path(__file__).parents[2]
PACKAGES = ("cases", "codegen", "generated", "runtime")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the files under version control; a link is a text file with its target."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode:
        pytest.skip("no checkout")
    place = tmp_path_factory.mktemp("checkout")
    for name in filter(None, os.fsdecode(listed.stdout).split("\0")):
        source, target = ROOT / name, place / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_symlink():
            target.write_text(os.readlink(source))
        elif source.is_file():
            shutil.copyfile(source, target)
    assert not (place / "src" / "softehl" / "runtime").is_dir()
    return place


def run(command: list[str], folder: Path, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_every_package_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setuptools, "setup", lambda **_: None)
    found = runpy.run_path(str(ROOT / "setup.py"))["packages"]()
    folders = {path.parent for name in PACKAGES for path in (ROOT / name).rglob("*.py")}
    names = {".".join(("softehl", *folder.relative_to(ROOT).parts)) for folder in folders}
    assert len(found) == len(set(found))
    assert set(found) == names | {"softehl"}


def test_a_checkout_without_links_runs(checkout: Path) -> None:
    code = "import softehl.runtime, softehl.codegen as c; softehl.main(['keys', 'oring']); "
    out = run(["-P", "-c", f"{code}print(c.__file__)"], checkout, PYTHONPATH=str(checkout / "src"))
    assert "sealed_pressure" in out
    assert Path(out.splitlines()[-1]) == checkout / "codegen" / "__init__.py"


@pytest.mark.slow
def test_a_checkout_without_links_installs(checkout: Path, tmp_path: Path) -> None:
    place = tmp_path / "site"
    pip = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    run([*pip, "--target", str(place), "."], checkout, CC="no-such-compiler")
    assert (place / "softehl" / "codegen" / "hosts" / "templates").is_dir()
    case = ["-P", "-m", "softehl", "run", "oring", "--quiet", "--out", "run"]
    run(case, tmp_path, PYTHONPATH=str(place))
    assert len((tmp_path / "run" / "curve.csv").read_text().splitlines()) > 2
