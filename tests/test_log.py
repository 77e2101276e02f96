"""The log of the package: its levels, and its silence until a script configures it."""

from __future__ import annotations

import logging
import subprocess
import sys
import warnings

import pytest

from softehl import Mesh, Study
from softehl.log import warn


def test_iterations_steps_and_warnings_have_their_levels(caplog: pytest.LogCaptureFixture) -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("block", material="neo_hooke", mu=0.4, kappa=2)
    study.fix("left", u_x=0, u_y=0)
    study.fix("right", u_x=0.5)
    with caplog.at_level(logging.DEBUG, logger="softehl"):
        result = study.solve(progress=False)
        with pytest.warns(RuntimeWarning, match="look out"):
            warn("look out", RuntimeWarning)
    texts: dict[int, list[str]] = {
        level: [] for level in (logging.DEBUG, logging.INFO, logging.WARNING)
    }
    for record in caplog.records:
        texts[record.levelno].append(record.getMessage())
    last = [f"Newton iteration {n}" for n in range(result.iterations + 1)]
    newton = [text.partition(":")[0] for text in texts[logging.DEBUG] if "iteration" in text]
    assert newton[-len(last) :] == last
    assert [text.partition(",")[0] for text in texts[logging.INFO]] == [
        "step 1: load factor 1 of 1"
    ]
    assert texts[logging.WARNING] == ["look out"]


def test_a_warning_names_the_line_of_its_caller() -> None:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        warn("look out")
    assert [(w.filename, w.category) for w in seen] == [(__file__, UserWarning)]


def test_the_log_is_silent_until_it_is_configured() -> None:
    code = "from softehl.log import LOG; LOG.error('nobody listens')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""
