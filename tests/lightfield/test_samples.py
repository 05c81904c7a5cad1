"""Views picked for looking about the pupil."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.samples import sample_views


@pytest.mark.parametrize(
    ("grid", "step", "count", "reach"),
    [
        ((15, 15), 2, 45, 6),
        ((9, 9), 2, 21, 4),
        ((7, 7), 1, 37, 3),
        ((5, 5), 1, 21, 2),
        ((1, 5), 1, 5, 2),
        ((1, 1), 1, 1, 0),
    ],
)
def test_even_steps_about_the_centre(grid: tuple[int, int], step: int, count: int, reach: int) -> None:
    """Counts are lattice points within half the shorter side, counted by hand on squared paper."""
    samples = sample_views(LightField(np.zeros((*grid, 2, 3, 3), np.float32), None, None, "", "grid"))
    assert (samples.step, len(samples.places), samples.views_in_all) == (step, count, grid[0] * grid[1])
    assert (0, 0) in samples.places
    assert max(abs(n) for place in samples.places for n in place) == reach
    assert all(n % step == 0 for place in samples.places for n in place)


def test_each_picture_is_the_view_at_its_place() -> None:
    views = np.zeros((5, 5, 1, 1, 3), np.float32)
    for t in range(5):
        views[t, :, 0, 0] = np.arange(5)[:, None] * 0.02 + t * 0.1
    samples = sample_views(LightField(views, None, None, "", "ramp"), gain=1.5)
    for (s, t), picture in zip(samples.places, samples.pictures, strict=True):
        np.testing.assert_array_equal(picture, srgb8(views[2 + t, 2 + s] * np.float32(1.5)))
