"""Slices between slices."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.focus.even_slices import even_stack


def test_even_slices_stay_as_they_are() -> None:
    slices = np.random.default_rng(0).random((16, 2, 3, 3), dtype=np.float32)
    stack = even_stack(slices, np.linspace(90, 15, 16), 0.1, "sweep")
    np.testing.assert_allclose(stack.slices, slices, atol=1e-6)
    np.testing.assert_allclose(stack.disparities_px, np.linspace(90, 15, 16))


def test_uneven_slices_are_interpolated() -> None:
    """Pictures whose value is the disparity they are focused at; steps of 1 to 2 px for new ones of 2 px."""
    focused = np.array([30, 28, 26.5, 25, 24, 22, 20.5, 19, 17, 15, 14, 12, 10.5, 9, 8, 6, 4, 2, 0.0])
    slices = np.tile(focused.astype(np.float32)[:, None, None, None], (1, 2, 3, 3))
    stack = even_stack(slices, focused, 0.1, "sweep")
    np.testing.assert_allclose(stack.slices[:, 1, 2, 0], np.linspace(30, 0, 16), atol=1e-5)


def test_refuses_gaps() -> None:
    with pytest.raises(
        ConfigError, match=r"sweep: found slices up to 4.00 px of disparity apart, expected at most 0.67"
    ):
        even_stack(np.zeros((5, 1, 1, 3), np.float32), np.array([10.0, 8, 4, 2, 0]), 0.1, "sweep")
