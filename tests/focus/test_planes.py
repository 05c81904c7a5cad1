"""Planes of focus in slopes, disparities and metres."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.focus.planes import FocusPlanesOptions, choose_slopes
from lfstereo.focus.scale import FocusScale
from lfstereo.lightfield.field import LightField

FIELD = LightField(np.zeros((15, 15, 4, 4, 3), np.float32), None, None, "", "test")
SCALE = FocusScale(slope_per_disparity=0.01, slope_at_zero=-0.3, focal_px=1000.0, baseline_m=0.1, doffs_px=90.0)


def test_slices_are_even_between_the_limits() -> None:
    found = choose_slopes([FIELD], FocusPlanesOptions(near=0.3, far=-0.2, slices=6))
    np.testing.assert_allclose(found, [0.3, 0.2, 0.1, 0.0, -0.1, -0.2], atol=1e-12)


def test_metres_and_disparities_name_the_same_planes() -> None:
    """z = 100 / (d + 90): 1 m is 10 px, 0.5 m is 110 px."""
    metres = choose_slopes([FIELD], FocusPlanesOptions(near=0.5, far=1.0, slices=3, unit="metres"), SCALE)
    px = choose_slopes([FIELD], FocusPlanesOptions(near=110.0, far=10.0, slices=3, unit="disparity"), SCALE)
    np.testing.assert_allclose(metres, px)
    np.testing.assert_allclose(SCALE.disparities(metres), [110, 60, 10])
    np.testing.assert_allclose(SCALE.depths(metres), [0.5, 100 / 150, 1.0])
    assert SCALE.depths(np.array([-2.0])).tolist() == [np.inf]


def test_planes_one_by_one_keep_their_order() -> None:
    found = choose_slopes([FIELD], FocusPlanesOptions(at=(0.1, 0.4, -0.2)))
    np.testing.assert_allclose(found, [0.1, 0.4, -0.2])
    theirs = choose_slopes([FIELD], FocusPlanesOptions(at=(0.28,), slope_rule="lftoolbox"))
    np.testing.assert_allclose(theirs, [-0.3])


@pytest.mark.parametrize(
    "options, scale, message",
    [
        (FocusPlanesOptions(unit="metres", at=(1.0,)), None, "found no rig"),
        (FocusPlanesOptions(unit="metres", at=(0.0,)), SCALE, "in front of the cameras"),
        (FocusPlanesOptions(unit="metres", at=(1.0,), slope_rule="lftoolbox"), SCALE, "expected slope"),
        (FocusPlanesOptions(near=0.1, far=0.2), None, "expected near above far"),
        (FocusPlanesOptions(near=0.2, far=0.1, slices=1), None, "slices = 1"),
        (FocusPlanesOptions(at=(np.nan,)), None, "finite numbers"),
    ],
)
def test_refuses_impossible_planes(options: FocusPlanesOptions, scale: FocusScale | None, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        choose_slopes([FIELD], options, scale)
