"""Saddle points: exact on a polynomial, unbiased within the pixel, and refused where there are none."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.rig.saddle import saddle_points

PLACE_TOLERANCE_PX = 0.01
"""Of a blurred corner, codes of 8 bits."""
UNBIASED_PX = 0.005


def corner(x: float, y: float, turn: float = 0.3, blur: float = 1.2, size: int = 41) -> np.ndarray:
    """Paint four squares that meet at (x, y): the product of two smooth edges."""
    row, column = np.mgrid[:size, :size].astype(np.float64)
    c, s = np.cos(turn), np.sin(turn)
    across, down = c * (column - x) + s * (row - y), -s * (column - x) + c * (row - y)
    return np.rint(128 + 100 * np.tanh(across / blur) * np.tanh(down / blur)).astype(np.uint8)


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.78])
@pytest.mark.parametrize("reach", [3, 5, 8])
def test_a_corner_is_found_anywhere_within_a_pixel(turn: float, reach: int) -> None:
    misses = []
    for part in np.linspace(-0.5, 0.5, 11):
        truth = np.array([[20 + part, 20.3 - part]])
        found, good = saddle_points(corner(*truth[0], turn), truth + np.array([0.4, -0.3]), reach)
        assert good.all()
        misses.append((found - truth)[0])
    assert np.abs(misses).max() < PLACE_TOLERANCE_PX
    assert np.abs(np.mean(misses, axis=0)).max() < UNBIASED_PX


def test_a_polynomial_s_saddle_is_exact() -> None:
    row, column = np.mgrid[:30, :30]
    picture = (128 + (column - 14) * (row - 16)).clip(0, 255).astype(np.uint8)
    found, good = saddle_points(picture, np.array([[15.2, 15.1]]), 4)
    np.testing.assert_allclose(found, [[14.0, 16.0]], atol=1e-9)
    assert good.all()


def test_what_is_no_saddle_stays_where_it_was() -> None:
    row, column = np.mgrid[:40, :40]
    hill = np.rint(255 * np.exp(-((column - 20) ** 2 + (row - 20) ** 2) / 50)).astype(np.uint8)
    guesses = np.array([[20.2, 19.7], [1.0, 20.0], [np.nan, 3.0]])
    found, good = saddle_points(hill, guesses, 4)
    assert not good.any()
    np.testing.assert_array_equal(found, guesses)
    far = saddle_points(corner(20, 20), np.array([[12.0, 20.0]]), 4)
    assert not far[1].any() or np.hypot(*(far[0][0] - [20, 20])) > 1
