"""What all tests share."""

import gc

import numpy as np
import pytest


def pytest_configure() -> None:
    """Look for cycles rarely: a quarter of the time of compiling went into it."""
    gc.set_threshold(100_000, 20, 20)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start with tests of a minute: two processes then end together."""
    items.sort(key=lambda item: item.get_closest_marker("first") is None)


def pytest_collection_finish() -> None:
    """Leave modules and tests, which stay to the end, out of it."""
    gc.freeze()


@pytest.fixture
def rng() -> np.random.Generator:
    """A random generator that starts the same in every test."""
    return np.random.default_rng(20090642)
