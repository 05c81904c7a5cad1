"""Refocusing of any light field: linear in the light, no light lost, the same under mirrors."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField

ALL_VIEWS = RefocusOptions(aperture="all")
ROUNDING = 3e-6
"""Linear RGB of order 1, summed in float32."""
slopes = st.floats(-1.5, 1.5)
grids = st.sampled_from([(1, 3), (3, 3), (5, 3), (3, 5)])
seeds = st.integers(0, 2**32 - 1)


def field(views: np.ndarray, weight: np.ndarray | None = None) -> LightField:
    return LightField(np.ascontiguousarray(views, np.float32), weight, None, "", "test")


def random_views(seed: int, grid: tuple[int, int], size: tuple[int, int] = (9, 12)) -> np.ndarray:
    return np.random.default_rng(seed).random((*grid, *size, 3), np.float32)


@settings(max_examples=25)
@given(seeds, grids, slopes, st.floats(-2, 2), st.floats(-2, 2))
def test_linear_in_the_light(seed: int, grid: tuple[int, int], slope: float, a: float, b: float) -> None:
    one, two = random_views(seed, grid), random_views(seed + 1, grid)
    found = refocus(field(np.float32(a) * one + np.float32(b) * two), [slope], ALL_VIEWS)
    parts = np.float32(a) * refocus(field(one), [slope], ALL_VIEWS)
    parts += np.float32(b) * refocus(field(two), [slope], ALL_VIEWS)
    np.testing.assert_allclose(found, parts, atol=4 * ROUNDING)


@settings(max_examples=25)
@given(seeds, grids, slopes)
def test_no_light_is_lost(seed: int, grid: tuple[int, int], slope: float) -> None:
    """What lies far from the border keeps its sum, whatever is in focus."""
    views = np.zeros((*grid, 21, 23, 3), np.float32)
    views[:, :, 9:12, 10:13] = random_views(seed, grid, (3, 3))
    found = refocus(field(views), [slope], ALL_VIEWS)[0].sum((0, 1), dtype=np.float64)
    np.testing.assert_allclose(found, views.sum((2, 3), dtype=np.float64).mean((0, 1)), rtol=1e-5)


@settings(max_examples=25)
@given(seeds, grids, slopes, st.booleans())
def test_a_mirrored_scene_gives_the_mirrored_picture(
    seed: int, grid: tuple[int, int], slope: float, weighted: bool
) -> None:
    """Left and right exchanged in views and pupil keep the slope; exchanged in the pupil alone they reverse it."""
    views = random_views(seed, grid)
    weight = np.random.default_rng(seed).integers(1, 256, views.shape[:4], dtype=np.uint8) if weighted else None

    def seen(s: slice, u: slice, t: slice, v: slice, at: float) -> np.ndarray:
        turned = None if weight is None else np.ascontiguousarray(weight[t, s, v, u])
        return refocus(field(views[t, s, v, u], turned), [at], ALL_VIEWS)[0]

    same, back = slice(None), slice(None, None, -1)
    plain = seen(same, same, same, same, slope)
    np.testing.assert_allclose(seen(back, back, same, same, slope), plain[:, ::-1], atol=ROUNDING)
    np.testing.assert_allclose(seen(same, same, back, back, slope), plain[::-1], atol=ROUNDING)
    np.testing.assert_allclose(seen(back, same, back, same, slope), seen(same, same, same, same, -slope), atol=ROUNDING)


@settings(max_examples=15)
@given(seeds, grids, slopes)
def test_rows_and_columns_are_alike(seed: int, grid: tuple[int, int], slope: float) -> None:
    views = random_views(seed, grid)
    turned = views.transpose(1, 0, 3, 2, 4)
    plain = refocus(field(views), [slope], ALL_VIEWS)[0]
    np.testing.assert_allclose(refocus(field(turned), [slope], ALL_VIEWS)[0], plain.transpose(1, 0, 2), atol=ROUNDING)
