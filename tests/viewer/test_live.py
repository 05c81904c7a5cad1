"""Live refocusing agrees with exact refocusing; slopes are found where the scene has them."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.samples import sample_views
from lfstereo.viewer.live import LiveFocus, live_field, live_field_from_pictures, picture_of, render, slope_map

from .conftest import COLUMNS, FAR_PX, NEAR_PX, ROWS, SLOPE_FROM_DISPARITY, light_field

CODE_STEP = 0.008
"""Largest difference of linear light that 8-bit square roots leave, about two codes at white."""
TILE_SLOPE = 0.02
"""Largest difference of linear light where the slope is constant inside a tile but should change."""
SLOPE_STEP = 0.1
"""Five views across tell a slope to about a quarter px at the rim; linear shifts look sharper at whole px."""
INNER = (slice(None), slice(8, -8), slice(8, -8))
"""Away from the border, where views are continued instead of left out."""


@pytest.mark.parametrize("slope", [-0.44, 0.0, 0.13, 0.4])
@pytest.mark.parametrize("radius", [0.7, 1.6, 2.5])
def test_agrees_with_exact_refocusing(slope: float, radius: float) -> None:
    field = light_field()
    exact = refocus(field, [slope], RefocusOptions(radius_views=radius))
    live = render(live_field(field, 1.0), LiveFocus(slope, radius))
    np.testing.assert_allclose(live[None][INNER], exact[INNER], atol=CODE_STEP)


@pytest.mark.parametrize("tilt", [(0.3, 0.0), (0.0, -0.25), (0.2, 0.2)])
def test_tilted_plane_agrees_with_exact_refocusing(tilt: tuple[float, float]) -> None:
    field = light_field()
    exact = refocus(field, [0.1], RefocusOptions(tilt=tilt))
    live = render(live_field(field, 1.0), LiveFocus(0.1, 2.5, tilt))
    away = np.abs(live[None][INNER] - exact[INNER])
    assert away.mean() < CODE_STEP / 4
    assert np.percentile(away, 99) < TILE_SLOPE


def test_views_of_any_order_and_without_a_full_grid() -> None:
    samples = sample_views(light_field())
    order = np.random.default_rng(1).permutation(len(samples.places))
    forwards = live_field_from_pictures(list(samples.pictures), list(samples.places))
    shuffled = live_field_from_pictures([samples.pictures[n] for n in order], [samples.places[n] for n in order])
    focus = LiveFocus(0.4, 2.5)
    np.testing.assert_allclose(render(shuffled, focus), render(forwards, focus), atol=1e-5)
    exact = refocus(light_field(), [0.4])
    np.testing.assert_allclose(render(forwards, focus)[None][INNER], exact[INNER], atol=2 * CODE_STEP)


def test_samples_without_confidence_show_the_centre_view() -> None:
    field = light_field(3)
    weight = np.full(field.views.shape[:4], 255, np.uint8)
    weight[0, 0, 20:30] = 0
    spoilt = field.views.copy()
    spoilt[0, 0, 20:30] = 50.0
    live = live_field(LightField(spoilt, weight, None, "", "spoilt"), 1.0)
    assert render(live, LiveFocus(0.0, 2.5)).max() < 1.05


def test_one_row_of_views_has_an_aperture() -> None:
    field = light_field(5)
    row = LightField(field.views[2:3], None, None, "", "row")
    live = live_field(row, 1.0)
    assert live.radius_views == 2.5
    exact = refocus(row, [0.2])
    np.testing.assert_allclose(render(live, LiveFocus(0.2, 2.5))[None][INNER], exact[INNER], atol=CODE_STEP)


def test_pictures_are_srgb_at_the_page_s_brightness() -> None:
    grey = LightField(np.full((2, 2, 4, 4, 3), 0.1, np.float32), None, None, "", "grey")
    live = live_field(grey, 2.0)
    picture = picture_of(live, render(live, LiveFocus(0.0, 1.5)))
    assert np.abs(picture.astype(int) - int(srgb8(np.float32([0.2]))[0])).max() <= 1


def test_finds_the_slopes_of_both_halves() -> None:
    slopes, (far, near) = slope_map(live_field(light_field(), 1.0))
    expected = [SLOPE_FROM_DISPARITY[0] * d + SLOPE_FROM_DISPARITY[1] for d in (NEAR_PX, FAR_PX)]
    halves = slopes[12:-12, 12 : COLUMNS // 2 - 12], slopes[12:-12, COLUMNS // 2 + 12 : -12]
    assert slopes.shape == (ROWS, COLUMNS)
    for half, slope in zip(halves, expected, strict=True):
        assert abs(float(np.median(half)) - slope) < SLOPE_STEP
    assert far < expected[1] < expected[0] < near


def test_refuses_what_cannot_be() -> None:
    live = live_field(light_field(), 1.0)
    with pytest.raises(ConfigError, match="radius = 0"):
        render(live, LiveFocus(0.0, 0.0))
    with pytest.raises(ConfigError, match="radius = nan"):
        render(live, LiveFocus(0.0, float("nan")))
    with pytest.raises(ConfigError, match="px per view, expected at most"):
        render(live, LiveFocus(live.largest_slope, 2.5, (0.1, 0.0)))
