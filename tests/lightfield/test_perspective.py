"""Perspectives from between the views, quilts and epipolar-plane images."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.perspective import QuiltOptions, perspective_view, quilt, quilt_name
from lfstereo.lightfield.views import horizontal_epi, vertical_epi

TOLERANCE = 1e-4  # linear RGB


def ramp(slope: float) -> LightField:
    y, x = np.mgrid[:20, :30].astype(np.float32)
    views = [[0.2 + 0.01 * (x + slope * (s - 2)) + 0.005 * (y + slope * (t - 1)) for s in range(5)] for t in range(3)]
    return LightField(np.repeat(np.float32(views)[..., None], 3, axis=-1), None, None, "", "test")


def test_at_a_view_it_is_that_view() -> None:
    field = ramp(0.8)
    np.testing.assert_allclose(perspective_view(field, (-2, 1), 0.3), field.views[2, 0], atol=TOLERANCE)
    np.testing.assert_allclose(perspective_view(field, (9, -9)), field.views[0, 4], atol=TOLERANCE)


@pytest.mark.parametrize("position", [(0.5, 0.0), (-1.25, 0.75), (1.5, -0.5)])
def test_between_views_things_lie_between(position: tuple[float, float]) -> None:
    y, x = np.mgrid[:20, :30]
    expected = 0.2 + 0.01 * (x + 0.8 * position[0]) + 0.005 * (y + 0.8 * position[1])
    found = perspective_view(ramp(0.8), position, 0.8)[2:-2, 2:-2, 1]
    np.testing.assert_allclose(found, expected[2:-2, 2:-2], atol=TOLERANCE)


def test_quilt_runs_from_bottom_left_to_top_right() -> None:
    views = np.broadcast_to(np.linspace(0.1, 0.9, 5, dtype=np.float32)[None, :, None, None, None], (3, 5, 4, 6, 3))
    field = LightField(views.copy(), None, None, "", "test")
    found = quilt(field, QuiltOptions(columns=3, rows=2))
    assert found.shape == (8, 18, 3)
    tiles = found.reshape(2, 4, 3, 6, 3)[:, 0, :, 0, 0][::-1].ravel()
    np.testing.assert_array_equal(tiles, srgb8(np.linspace(0.1, 0.9, 6, dtype=np.float32)))


def test_quilt_holds_its_slope_still_and_takes_any_tile_size() -> None:
    found = quilt(ramp(1.0), QuiltOptions(columns=5, rows=1, slope=1.0, reach_views=1.5))
    tiles = found.reshape(20, 5, 30, 3)[2:-2, :, 3:-3].astype(int)
    assert np.abs(tiles - tiles[:, 2:3]).max() <= 1
    small = quilt(ramp(1.0), QuiltOptions(columns=2, rows=2, tile_width_px=15))
    assert small.shape == (20, 30, 3)
    assert quilt_name("a", ramp(1.0), QuiltOptions(columns=2, rows=2, tile_width_px=15)) == "a_qs2x2a1.50.png"


def test_epipolar_images_of_any_row_and_column() -> None:
    field = ramp(0.8)
    np.testing.assert_array_equal(horizontal_epi(field, 7, 2), field.views[2, :, 7])
    np.testing.assert_array_equal(vertical_epi(field, 9, 4), field.views[:, 4, :, 9])
    np.testing.assert_array_equal(horizontal_epi(field, 7), field.views[1, :, 7])
    for draw, index, of_views in ((horizontal_epi, 20, None), (vertical_epi, 30, None), (vertical_epi, 3, 5)):
        with pytest.raises(ConfigError, match=r"test: found (row|column)"):
            draw(field, index, of_views)


@pytest.mark.parametrize(
    "options", [QuiltOptions(columns=0), QuiltOptions(tile_width_px=-1), QuiltOptions(reach_views=3.0)]
)
def test_refuses_impossible_quilts(options: QuiltOptions) -> None:
    with pytest.raises(ConfigError, match=r"(quilt of|reach_views = )"):
        quilt(ramp(1.0), options)


def test_refuses_places_that_are_none() -> None:
    with pytest.raises(ConfigError, match="finite numbers"):
        perspective_view(ramp(1.0), (np.nan, 0.0))
