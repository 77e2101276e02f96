"""Pictures: what is drawn, files, and errors that say what there is."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import softehl
from softehl import Mesh, MissingPyvista, PictureError, Study, StudyError, animate
from softehl.runtime.results.plotting import picture_of

PNG = b"\x89PNG"


def block(dimension: int = 2) -> softehl.Result:
    """A stretched block of two materials."""
    mesh = (
        Mesh.rectangle(2, 1, cells=(2, 1), order=2)
        if dimension == 2
        else Mesh.box((2, 1, 1), cells=(2, 1, 1))
    )
    mesh = mesh.with_group("soft", lambda x: x[:, 0] < 1).with_group("hard", lambda x: x[:, 0] > 1)
    study = Study(mesh)
    for name, E in (("soft", 1.0), ("hard", 3.0)):
        study.add(name, material="hooke", cells=name, E=E, nu=0.0)
    study.fix("left", u_x=0)
    study.fix((0.0,) * dimension, **dict.fromkeys(("u_y", "u_z")[: dimension - 1], 0))
    if dimension == 3:
        study.fix("bottom", u_z=0)
    study.load("right", u_x=0.3)
    return study.solve()


def test_what_is_drawn() -> None:
    result = block()
    u = picture_of(result, "u_x", deformed=2.0)
    np.testing.assert_allclose(np.asarray(u.values), result.values("u_x"))
    np.testing.assert_allclose(
        u.points[:, 0], result.system.mesh.points[:, 0] + 2 * result.values("u_x")
    )
    assert picture_of(result, "u").label == "|u|"
    assert len(picture_of(result, "sigma_xx", block="soft").cells["quad9"]) == 1
    # the stress is 0.3 in both; at common nodes it is the mean of both blocks
    np.testing.assert_allclose(np.asarray(picture_of(result, "von_mises").values), 0.3)
    strained = picture_of(result, "von_mises", block="hard").values
    assert np.isnan(np.asarray(strained)).sum() == 6
    with pytest.raises(StudyError, match=r"no unknown or field 'sigma' .did you mean"):
        picture_of(result, "sigma")
    with pytest.raises(KeyError, match="no block 'sof'"):
        picture_of(result, "sigma_xx", block="sof")
    assert u.limits == pytest.approx((0.0, result.values("u_x").max()))


def test_a_frame_is_drawn_without_edges_and_has_no_von_mises() -> None:
    study = Study(Mesh.frame([(0, 0), (0, 10)], cells=2))
    study.add("mast", element="beam2d_reissner", EA=1e3, GA=1e3, EI=1e3)
    study.fix((0, 0), u_x=0, u_y=0, theta=0)
    study.load((0, 10), u_x=0.1)
    result = study.solve()
    assert not picture_of(result, "u").edges
    with pytest.raises(StudyError, match="von_mises needs fields sigma_xx"):
        picture_of(result, "von_mises")
    assert result.reaction((0, 0))["u_x"] == pytest.approx(-0.1)


def test_files_of_pictures(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    result = block()
    result.plot("sigma_xx", deformed=True, file=tmp_path / "new" / "stress.png")
    assert (tmp_path / "new" / "stress.png").read_bytes().startswith(PNG)
    with pytest.raises(PictureError, match=r"file = 'stress.vtu': pictures end in .png"):
        result.plot("sigma_xx", file="stress.vtu")
    with pytest.raises(PictureError, match="the mesh has no groups"):
        Mesh.rectangle(1, 1, cells=(1, 1)).plot(groups=True, file=tmp_path / "groups.png")


@pytest.mark.slow
def test_pictures_in_space_of_paths_and_in_time(tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    result = block(3)
    result.plot("u", deformed=True, file=tmp_path / "u.png")
    result.system.mesh.plot(groups=True, file=tmp_path / "mesh.svg")
    Mesh.box((1, 1, 1), cells=(1, 1, 1), order=3).plot(file=tmp_path / "cubic.png")
    animate([result, result], "u_x", file=tmp_path / "u.gif")
    study = Study(Mesh.rectangle(1, 1, cells=(1, 1)))
    study.add("body", material="hooke", E=1, nu=0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    path = study.follow(step=0.5, until=lambda r: r.t >= 1)
    path.plot("u_x", at=(1, 1), file=tmp_path / "path.png")
    for name in ("u.png", "mesh.svg", "cubic.png", "u.gif", "path.png"):
        assert (tmp_path / name).stat().st_size > 1000, name
    with pytest.raises(StudyError, match=r"animations end in .gif or .mp4"):
        animate([result], file=tmp_path / "u.png")
    with pytest.raises(StudyError, match="there is no result"):
        animate([], file=tmp_path / "u.gif")


def test_pictures_without_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingPyvista, match=r"pip install 'softehl\[plot\]'"):
        Mesh.rectangle(1, 1, cells=(1, 1)).plot(file="mesh.png")
