"""Shift-and-add with the toolbox's rules, on small light fields."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.lftoolbox import ShiftSumOptions, refocus_as_lftoolbox, slopes_by_rule

TOLERANCE = 1e-6  # linear RGB


def test_slope_rule() -> None:
    np.testing.assert_allclose(slopes_by_rule([0.28, -1.4], "lftoolbox", 15), [-0.3, 1.5])
    np.testing.assert_allclose(slopes_by_rule([0.28, -1.4], "per-view", 15), [0.28, -1.4])
    np.testing.assert_allclose(slopes_by_rule([0.5], "lftoolbox", 1), [-0.5])


def test_a_point_is_sharp_at_its_slope() -> None:
    views = np.zeros((1, 3, 1, 9, 3), np.float32)
    for s in range(3):
        views[0, s, 0, 4 - (s - 1)] = 1.0
    found = refocus_as_lftoolbox(views, None, -2 / 3)  # nearer is negative; 3 views: 3/2 of the slope between two
    assert found.picture[0, 4, 0] == pytest.approx(1.0)
    assert found.picture[0, 2, 0] == found.picture[0, 6, 0] == 0
    assert found.weight is not None and found.weight[0, 4] == 3


def test_minimum_and_mask() -> None:
    views = np.full((1, 3, 4, 4, 3), 0.5, np.float32)
    views[0, 1] = 0.1
    weight = np.ones((1, 3, 4, 4), np.float32)
    assert refocus_as_lftoolbox(views, weight, 0.0, ShiftSumOptions("min")).picture.max() == pytest.approx(0.1)
    weight[0, 1] = 0.3
    masked = refocus_as_lftoolbox(views, weight, 0.0, ShiftSumOptions("median", mask=True))
    np.testing.assert_allclose(masked.picture, 0.5, atol=TOLERANCE)
    assert masked.weight is None


def test_without_weight_it_is_black() -> None:
    found = refocus_as_lftoolbox(np.ones((2, 2, 3, 3, 3), np.float32), np.zeros((2, 2, 3, 3), np.float32), 0.1)
    assert not found.picture.any()


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_small_views_can_be_read_between(interpolation: str) -> None:
    ramp = np.broadcast_to(np.arange(2, dtype=np.float32)[None, None, None, :, None], (1, 1, 1, 2, 3)).copy()
    options = ShiftSumOptions(interpolation=interpolation, upsample=2)  # type: ignore[arg-type]
    found = refocus_as_lftoolbox(ramp, None, 0.0, options)
    np.testing.assert_allclose(found.picture[0, :, 0], [0, 1 / 3, 2 / 3, 1], atol=TOLERANCE)


def test_refuses_what_does_not_fit() -> None:
    views = np.zeros((1, 1, 4, 4, 3), np.float32)
    with pytest.raises(ShapeError, match="weight: found an array of shape"):
        refocus_as_lftoolbox(views, np.zeros((1, 1, 4, 5), np.float32), 0.0)
    with pytest.raises(ConfigError, match="mask: found views without weights"):
        refocus_as_lftoolbox(views, None, 0.0, ShiftSumOptions(mask=True))
    with pytest.raises(ConfigError, match=r"upsample = 0\.1"):
        refocus_as_lftoolbox(views, None, 0.0, ShiftSumOptions(upsample=0.1))
