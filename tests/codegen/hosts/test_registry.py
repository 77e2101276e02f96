"""Hosts by entry points: those of softehl, and one that another package registers."""

from __future__ import annotations

import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from softehl.codegen.abi import TargetError
from softehl.codegen.hosts import registry
from softehl.codegen.models import ALL
from softehl.codegen.tools import cli, host_files

ROOT = Path(__file__).parents[3]
OTHER = "tests.codegen.hosts.test_registry"
NAMES = registry.Host(element=lambda page, states: {"names.txt": f"{page.name} {len(states)}\n"})
NO_HOST = {"no": "host"}


@pytest.fixture
def _other(monkeypatch: pytest.MonkeyPatch) -> None:
    def installed(group: str) -> list[EntryPoint]:
        known = {"names": f"{OTHER}:NAMES", "wrong": f"{OTHER}:NO_HOST", "c": f"{OTHER}:NO_HOST"}
        return [EntryPoint(name, at, group) for name, at in known.items()]

    monkeypatch.setattr(registry, "entry_points", installed)


def test_the_hosts_of_softehl_are_those_of_its_metadata() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"][registry.GROUP] == registry.BUILT_IN
    for target in registry.BUILT_IN:
        host = registry.host(target)
        assert host.element or host.material


@pytest.mark.usefixtures("_other")
def test_a_package_registers_a_host(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = ROOT / "docs" / "models" / "neo_hooke.py"
    assert cli.generate([page], target="names", out=tmp_path) == 0
    assert (tmp_path / "names.txt").read_text() == "neo_hooke 2\n"
    assert "1 files of target names" in capsys.readouterr().out


@pytest.mark.usefixtures("_other")
def test_what_is_no_host_is_refused() -> None:
    with pytest.raises(TargetError, match="target wrong: its entry point is no softehl Host"):
        host_files.files(ALL["solid_q4"](), "wrong")
    assert registry.host("c").element is not None
