"""Invariants of stresses: closed forms, turned axes, and a result of a study."""

from __future__ import annotations

import numpy as np
import pytest

from softehl import Mesh, Study, principal_values, von_mises

NAMES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}


def test_invariants_do_not_depend_on_axes() -> None:
    rng = np.random.default_rng(1)
    for values in ((3.0, 1.0, -2.0), (2.0, 2.0, 2.0), (5.0, 0.0, 0.0)):
        Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        S = Q @ np.diag(values) @ Q.T
        fields = {f"s_{n}": np.array([S[i], np.nan]) for n, i in NAMES.items()}
        a, b, c = values
        equivalent = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2)
        assert von_mises(fields, "s")[0] == pytest.approx(equivalent, abs=1e-7)
        assert principal_values(fields, "s")[:, 0] == pytest.approx(values, abs=1e-13)
        assert np.isnan(principal_values(fields, "s")[:, 1]).all()
    with pytest.raises(KeyError, match=r"no field s_zz; .*Give what is missing.*'s_zz': 0.0"):
        von_mises({"s_xx": 1.0, "s_yy": 0.0, "s_xy": 0.0}, "s")


def test_invariants_of_a_sheared_block() -> None:
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("block", material="hooke", E=2.6, nu=0.3)
    study.fix("boundary", u_x=lambda x, t: 0.1 * t * x[:, 1], u_y=0)
    result = study.solve()
    shear = 0.1  # G = 1
    for fields in (result.fields("block"), result.at_nodes("block", recovery="spr")):
        np.testing.assert_allclose(von_mises(fields), np.sqrt(3) * shear)
        np.testing.assert_allclose(principal_values(fields)[0], shear)
    there = result.at((0.5, 0.5), block="block")
    assert principal_values(there) == pytest.approx([shear, 0, -shear])
