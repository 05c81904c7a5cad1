"""The conventions, pinned by numbers that can be checked by hand."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import numpy as np
import pytest

import lfstereo
from lfstereo import conventions
from lfstereo.focus.refocus import refocus
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.field import LightField


def test_depth_from_disparity_is_middleburys() -> None:
    assert conventions.depth_from_disparity(10.0, 1000.0, 0.1, 90.0) == pytest.approx(1.0)


def test_positive_slope_is_nearer_and_moves_left_as_the_view_moves_right() -> None:
    """A dot that sits at x = 20 in the centre view and moves by -2 px per view is sharp at slope +2."""
    views = np.zeros((1, 3, 9, 41, 3), np.float32)
    for s, x in enumerate((22, 20, 18)):
        views[0, s, 4, x] = 1.0
    stack = refocus(LightField(views, None, None, "", "dot"), np.array([2.0, 0.0, -2.0], np.float32))
    peaks = stack[:, 4, 20, 0]
    assert peaks[0] == pytest.approx(1.0, abs=1e-6)
    assert peaks[1] == pytest.approx(1 / 3, abs=1e-6)
    assert peaks[2] == pytest.approx(1 / 3, abs=1e-6)


def test_lenslet_rows_are_shifted_by_half_a_pitch() -> None:
    grid = LensletGrid((7.0, 6.0), (14.0, 0.0), (0.0, 12.0), 1, 3, 2, (40, 40), 0.0, 1.0, "given")
    np.testing.assert_allclose(grid.centres()[:, 0], [[7, 6], [14, 18], [7, 30]])
    np.testing.assert_allclose(grid.centres()[0, 1], [21, 6])


@pytest.mark.parametrize("name", [m.name for m in pkgutil.walk_packages(lfstereo.__path__, "lfstereo.")])
def test_examples_in_docstrings(name: str) -> None:
    if name.endswith("__main__"):
        return
    failed, _ = doctest.testmod(importlib.import_module(name))
    assert failed == 0


def test_public_names_exist() -> None:
    for name in lfstereo.__all__:
        assert callable(getattr(lfstereo, name))
    with pytest.raises(AttributeError, match="no attribute 'nosuch'"):
        _ = lfstereo.nosuch
