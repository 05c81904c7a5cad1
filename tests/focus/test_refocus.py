"""Shift-and-add against closed forms and against one warp per view."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import shift

from lfstereo.errors import ConfigError, InputError, ShapeError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights, blur_ratio
from lfstereo.focus.refocus import refocus, render_stack, slice_disparities
from lfstereo.focus.shift_kernels import compiled
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.field import LightField

ALL_VIEWS = RefocusOptions(aperture="all")
TOLERANCE = 2e-5  # linear RGB, values of order 1


def field_of(views: np.ndarray, weight: np.ndarray | None = None) -> LightField:
    return LightField(views.astype(np.float32), weight, None, "", "test")


def shifted_views(picture, slope: float, grid: tuple[int, int], size: tuple[int, int]) -> np.ndarray:
    """Views of a picture ``f(x, y)`` that lies at one slope: ``I_ts(x) = f(x + slope (s - s0))``."""
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float64)
    t0, s0 = grid[0] // 2, grid[1] // 2
    views = [[picture(x + slope * (s - s0), y + slope * (t - t0)) for s in range(grid[1])] for t in range(grid[0])]
    return np.repeat(np.array(views)[..., None], 3, axis=-1)


def one_warp_per_view(field: LightField, slope: float, aperture: np.ndarray) -> np.ndarray:
    count_t, count_s, rows, columns = field.views.shape[:4]
    t0, s0 = field.centre
    summed, total = np.zeros((rows, columns, 3)), np.zeros((rows, columns))
    for t in range(count_t):
        for s in range(count_s):
            weight = np.full((rows, columns), 1.0, np.float32)
            if field.weight is not None:
                weight = field.weight[t, s].astype(np.float32) / 255
            weight = weight * aperture[t, s]
            move = (slope * (t - t0), slope * (s - s0))
            summed += shift(field.views[t, s] * weight[..., None], (*move, 0), order=1, mode="grid-constant")
            total += shift(weight, move, order=1, mode="grid-constant")
    return summed / total[..., None]


@pytest.mark.parametrize("slope", [-0.7, 0.0, 0.35, 1.25])
def test_ramp_is_sharp_at_its_slope(slope: float) -> None:
    field = field_of(shifted_views(lambda x, y: 0.01 * x + 0.02 * y, slope, (5, 5), (40, 50)))
    found = refocus(field, [slope])[0, 4:-4, 4:-4, 0]
    y, x = np.mgrid[4:36, 4:46]
    np.testing.assert_allclose(found, 0.01 * x + 0.02 * y, atol=TOLERANCE)


def test_sinusoid_out_of_focus_fades_by_the_dirichlet_kernel() -> None:
    omega, views = 0.6, 7
    field = field_of(shifted_views(lambda x, _: np.cos(omega * x), 1.0, (1, views), (4, 60)))
    slopes = [2.0, 1.0, 0.0, -1.0]
    found = refocus(field, slopes, ALL_VIEWS)[:, 2, 15:45, 0]
    x = np.arange(15, 45)
    for slope, row in zip(slopes, found, strict=True):
        fade = np.mean(np.cos(omega * (1.0 - slope) * np.arange(-3, 4)))
        np.testing.assert_allclose(row, fade * np.cos(omega * x), atol=TOLERANCE)


@pytest.mark.parametrize("grid", [(5, 5), (4, 7), (1, 5), (10, 10)])
@pytest.mark.parametrize("weighted", [False, True])
def test_equals_one_warp_per_view(grid: tuple[int, int], weighted: bool) -> None:
    rng = np.random.default_rng(1)
    views = rng.random((*grid, 37, 45, 3))
    weight = rng.integers(1, 256, (*grid, 37, 45), dtype=np.uint8) if weighted else None
    field = field_of(views, weight)
    slopes = [1.3, 0.25, 0.0, -0.5, -2.0]
    for options in (ALL_VIEWS, RefocusOptions(radius_views=2.2)):
        found = refocus(field, slopes, options)
        for slope, slice_ in zip(slopes, found, strict=True):
            expected = one_warp_per_view(field, slope, aperture_weights(field, options))
            np.testing.assert_allclose(slice_, expected, atol=TOLERANCE)


def test_row_blocks_join_without_a_seam() -> None:
    views = np.random.default_rng(7).random((3, 3, 300, 9, 3))
    field = field_of(views)
    seen: list[tuple[int, int]] = []
    found = refocus(field, [0.9], ALL_VIEWS, lambda done, total: seen.append((done, total)))[0]
    np.testing.assert_allclose(found, one_warp_per_view(field, 0.9, np.ones((3, 3))), atol=TOLERANCE)
    assert seen == [(128, 300), (256, 300), (300, 300)]


def test_a_white_scene_stays_white_up_to_the_border() -> None:
    found = refocus(field_of(np.full((5, 5, 20, 30, 3), 0.8)), [3.5, 0.0, -1.25])
    np.testing.assert_allclose(found, 0.8, atol=TOLERANCE)


def test_refocusing_is_linear() -> None:
    rng = np.random.default_rng(2)
    a, b = rng.random((2, 3, 3, 12, 14, 3)).astype(np.float32)
    slopes = [0.4, -0.3]
    both = refocus(field_of(2 * a + b), slopes)
    np.testing.assert_allclose(both, 2 * refocus(field_of(a), slopes) + refocus(field_of(b), slopes), atol=TOLERANCE)


def test_a_sample_without_weight_does_not_count() -> None:
    views = np.full((3, 3, 8, 8, 3), 0.5)
    weight = np.full((3, 3, 8, 8), 255, np.uint8)
    views[0, 0], weight[0, 0] = 1e6, 0
    np.testing.assert_allclose(refocus(field_of(views, weight), [0.3])[0], 0.5, atol=TOLERANCE)


def test_a_pixel_that_no_weight_reaches_shows_the_centre_view() -> None:
    views = np.random.default_rng(3).random((3, 3, 8, 8, 3))
    weight = np.zeros((3, 3, 8, 8), np.uint8)
    np.testing.assert_allclose(refocus(field_of(views, weight), [0.3])[0], views[1, 1], atol=TOLERANCE)


def test_one_view_is_its_own_picture() -> None:
    views = np.random.default_rng(4).random((1, 1, 6, 7, 3))
    np.testing.assert_allclose(refocus(field_of(views), [5.0, -3.0]), np.repeat(views[0], 2, axis=0), atol=TOLERANCE)


def test_kernels_compile_where_no_cache_can_be_kept() -> None:
    """A function without a source file has nowhere to be cached, like an installation that nobody may write."""
    names: dict[str, object] = {}
    exec("def twice(x):\n    return 2 * x", names)
    assert compiled()(names["twice"])(21) == 42  # type: ignore[operator,type-var]


def test_disc_leaves_out_the_corner_views() -> None:
    weights = aperture_weights(field_of(np.zeros((15, 15, 1, 1, 3))))
    assert weights[0, 0] == 0 and weights[7, 7] == 1 and weights[7, 0] == 1
    assert weights.sum() == pytest.approx(np.pi * 7.5**2, rel=0.01)


def test_blur_of_an_edge_is_as_wide_as_the_ratio_says() -> None:
    """A step at slope 0 seen 4 px of disparity out of focus: a uniform blur of 15 views x 0.2 px/view = 3 px."""
    field = field_of(shifted_views(lambda x, _: (x > 29.5).astype(float), 0.0, (1, 15), (3, 60)))
    stack = render_stack(field, np.array([4.0, 0.0]), (0.05, 0.0), options=ALL_VIEWS)
    profile = np.diff(stack.slices[0, 1, :, 0].astype(np.float64))
    centre = np.average(np.arange(59), weights=profile)
    spread = np.average((np.arange(59) - centre) ** 2, weights=profile) - 1 / 6  # less linear interpolation's own
    assert stack.aperture_ratio == pytest.approx(0.75)
    assert np.sqrt(12 * spread) == pytest.approx(0.75 * 4.0, rel=0.05)


def test_stack_slices_follow_the_affine_law() -> None:
    field = field_of(np.random.default_rng(5).random((3, 3, 9, 9, 3)))
    stack = render_stack(field, slice_disparities(10.0, 0.0, 3), (0.04, -0.2), aperture_ratio=0.1)
    assert stack.disparities_px.tolist() == [10.0, 5.0, 0.0]
    np.testing.assert_allclose(stack.slices, refocus(field, [0.2, 0.0, -0.2]), atol=TOLERANCE)
    assert stack.aperture_ratio == 0.1


def test_blur_ratio_counts_view_steps() -> None:
    field = field_of(np.zeros((1, 5, 2, 2, 3)))
    assert blur_ratio(field, -0.25) == pytest.approx(1.25)
    assert blur_ratio(field, 0.25, RefocusOptions(radius_views=1.5)) == pytest.approx(0.75)


@pytest.mark.parametrize("slopes", [[], [[0.1]], 0.1])
def test_refuses_slopes_that_are_no_row(slopes: object) -> None:
    with pytest.raises(ShapeError, match=r"slopes of shape .*expected \(K,\)"):
        refocus(field_of(np.zeros((1, 1, 4, 4, 3))), slopes)  # type: ignore[arg-type]


@pytest.mark.parametrize("slope", [np.nan, np.inf, -4.5])
def test_refuses_slopes_that_leave_the_view(slope: float) -> None:
    with pytest.raises(InputError, match=r"test: slope .* px per view"):
        refocus(field_of(np.zeros((1, 1, 4, 4, 3))), [slope])


def test_refuses_views_of_another_type() -> None:
    field = LightField(np.zeros((1, 1, 4, 4, 3), np.uint8), None, None, "", "test")  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="views of type uint8, expected float32"):
        refocus(field, [0.0])


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan])
def test_refuses_an_aperture_without_area(radius: float) -> None:
    with pytest.raises(ConfigError, match="radius_views"):
        refocus(field_of(np.zeros((3, 3, 4, 4, 3))), [0.0], RefocusOptions(radius_views=radius))


def test_refuses_a_single_slice() -> None:
    with pytest.raises(InputError, match="found 1, expected at least 2"):
        slice_disparities(10.0, 0.0, 1)


def test_refuses_disparities_that_rise() -> None:
    with pytest.raises(InputError, match="from near to far"):
        slice_disparities(0.0, 10.0)
    with pytest.raises(ShapeError, match="must fall"):
        render_stack(field_of(np.zeros((1, 1, 4, 4, 3))), np.array([0.0, 1.0]), (0.1, 0.0))


@pytest.mark.parametrize("slices, disparities", [((2, 4, 4), (2,)), ((2, 4, 4, 3), (3,))])
def test_a_stack_has_one_disparity_per_slice(slices: tuple[int, ...], disparities: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match=r"test: (slices|disparities): found an array of shape"):
        FocalStack(np.zeros(slices, np.float32), -np.arange(disparities[0], dtype=np.float32), 0.1, "test")
