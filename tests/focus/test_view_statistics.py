"""Cubic and exact shifts, reductions over views, tilts and apertures, against closed forms."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from lfstereo.errors import ConfigError, InputError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights, blur_ratio
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField

TOLERANCE = 2e-5  # linear RGB, values of order 1
EXACT = 1e-4  # linear RGB, what single precision leaves of a shift by the spectrum


def field_of(views: np.ndarray, weight: np.ndarray | None = None) -> LightField:
    return LightField(views.astype(np.float32), weight, None, "", "test")


def waves(slope: float, grid: tuple[int, int], size: tuple[int, int], omega: float) -> np.ndarray:
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float64)
    t0, s0 = grid[0] // 2, grid[1] // 2
    views = [
        [
            0.5 + 0.4 * np.cos(omega * (x + slope * (s - s0))) * np.cos(omega * (y + slope * (t - t0)))
            for s in range(grid[1])
        ]
        for t in range(grid[0])
    ]
    return np.repeat(np.array(views)[..., None], 3, axis=-1)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("interpolation, limit", [("linear", 0.2), ("cubic", 0.04), ("fourier", 0.004)])
def test_better_shifts_keep_more_of_a_fine_wave(interpolation: str, limit: float, weighted: bool) -> None:
    """A wave of 1.3 rad per px, shifted by parts of a px: what interpolation loses of 0.4."""
    size, omega = (80, 86), 1.3
    weight = np.full((3, 5, *size), 200, np.uint8) if weighted else None
    field = field_of(waves(0.37, (3, 5), size, omega), weight)
    options = RefocusOptions(aperture="all", interpolation=interpolation)  # type: ignore[arg-type]
    found = refocus(field, [0.37], options)[0, 26:-26, 26:-26, 0]
    error = np.abs(found - field.views[1, 2, 26:-26, 26:-26, 0]).max()
    assert error < limit
    assert interpolation == "fourier" or error > limit / 4


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "fourier"])
def test_a_white_scene_stays_white_however_it_is_shifted(interpolation: str) -> None:
    for weight in (None, np.random.default_rng(0).integers(100, 256, (3, 3, 20, 24), dtype=np.uint8)):
        field = field_of(np.full((3, 3, 20, 24, 3), 0.8), weight)
        options = RefocusOptions(interpolation=interpolation)  # type: ignore[arg-type]
        np.testing.assert_allclose(refocus(field, [2.5, -0.3], options), 0.8, atol=EXACT)


def test_exact_shift_by_whole_pixels_is_a_shift() -> None:
    views = np.random.default_rng(1).random((1, 3, 30, 40, 3))
    found = refocus(field_of(views), [2.0], RefocusOptions(aperture="all", interpolation="fourier"))[0]
    moved = [np.roll(views[0, s], 2 * (s - 1), axis=1) for s in range(3)]
    np.testing.assert_allclose(found[:, 3:-3], np.mean(moved, axis=0)[:, 3:-3], atol=EXACT)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("weighted", [False, True])
def test_a_tilt_of_nothing_is_no_tilt(interpolation: str, weighted: bool) -> None:
    rng = np.random.default_rng(2)
    weight = rng.integers(60, 256, (4, 5, 18, 22), dtype=np.uint8) if weighted else None
    field = field_of(rng.random((4, 5, 18, 22, 3)), weight)
    flat = RefocusOptions(interpolation=interpolation)  # type: ignore[arg-type]
    tilted = RefocusOptions(interpolation=interpolation, tilt=(1e-9, 0.0))  # type: ignore[arg-type]
    inner = np.s_[:, 4:-4, 4:-4]
    np.testing.assert_allclose(refocus(field, [0.6], tilted)[inner], refocus(field, [0.6], flat)[inner], atol=TOLERANCE)


def test_a_tilted_plane_is_sharp_all_over() -> None:
    """Slope -0.5 at the left border and 0.5 at the right: ``I_s(x - slope(x) s) = f(x)``."""
    rows, columns = 8, 81
    x = np.arange(columns, dtype=np.float64)
    views = np.empty((1, 5, rows, columns, 3))
    for s in range(5):
        # Solve x_view = x - slope(x) (s - 2) with slope(x) = (x - 40) / 80 for x.
        source = (x - 40 * (s - 2) / 80) / (1 - (s - 2) / 80)
        views[0, s] = (0.5 + 0.4 * np.sin(0.6 * source))[None, :, None]
    options = RefocusOptions(aperture="all", interpolation="cubic", tilt=(1.0, 0.0))
    found = refocus(field_of(views), [0.0], options)[0, 4, 5:-5, 0]
    np.testing.assert_allclose(found, (0.5 + 0.4 * np.sin(0.6 * x))[5:-5], atol=4e-3)
    flat = refocus(field_of(views), [0.0], RefocusOptions(aperture="all"))[0, 4, 5:-5, 0]
    assert np.abs(flat - (0.5 + 0.4 * np.sin(0.6 * x))[5:-5]).max() > 0.02


@pytest.mark.parametrize(
    "reduction, over",
    [("median", np.median), ("max", np.max), ("min", np.min), ("deviation", np.std), ("mean", np.mean)],
)
def test_reductions_are_those_of_the_shifted_views(reduction: str, over: object) -> None:
    views = np.random.default_rng(3).random((3, 4, 16, 20, 3))
    options = RefocusOptions(aperture="all", reduction=reduction)  # type: ignore[arg-type]
    found = refocus(field_of(views), [0.7], options)[0]
    y, x, c = np.mgrid[:16, :20, :3].astype(np.float64)
    shifted = [
        map_coordinates(views[t, s], [y - 0.7 * (t - 1), x - 0.7 * (s - 2), c], order=1)
        for t in range(3)
        for s in range(4)
    ]
    inner = np.s_[2:-2, 2:-2]
    np.testing.assert_allclose(found[inner], over(np.array(shifted), axis=0)[inner], atol=TOLERANCE)  # type: ignore[operator]


def test_deviation_is_least_where_the_scene_is() -> None:
    field = field_of(waves(0.4, (3, 5), (30, 40), 0.8))
    slopes = [0.8, 0.6, 0.4, 0.2, 0.0]
    found = refocus(field, slopes, RefocusOptions(aperture="all", reduction="deviation", interpolation="fourier"))
    spread = found[:, 8:-8, 8:-8].mean(axis=(1, 2, 3))
    assert spread.argmin() == 2
    assert spread[2] < 0.05 * spread[0]


def test_median_and_extremes_respect_weights() -> None:
    views = np.full((1, 5, 6, 8, 3), 0.2)
    views[0, 3:] = 0.9
    weight = np.full((1, 5, 6, 8), 255, np.uint8)
    weight[0, 0], weight[0, 4] = 0, 255
    for reduction, expected in (("median", 0.55), ("max", 0.9), ("min", 0.2)):
        options = RefocusOptions(aperture="all", reduction=reduction)  # type: ignore[arg-type]
        np.testing.assert_allclose(refocus(field_of(views, weight), [0.0], options), expected, atol=TOLERANCE)
    weight[0, 3:] = 100
    masked = RefocusOptions(aperture="all", reduction="max", least_weight=0.5)
    np.testing.assert_allclose(refocus(field_of(views, weight), [0.0], masked), 0.2, atol=TOLERANCE)
    light = RefocusOptions(aperture="all", reduction="median")
    np.testing.assert_allclose(refocus(field_of(views, weight), [0.0], light), 0.2, atol=TOLERANCE)


def test_without_any_weight_the_centre_view_shows_and_nothing_deviates() -> None:
    views = np.random.default_rng(4).random((3, 3, 5, 6, 3))
    field = field_of(views, np.zeros((3, 3, 5, 6), np.uint8))
    median = refocus(field, [0.2], RefocusOptions(reduction="median"))[0]
    np.testing.assert_allclose(median, views[1, 1], atol=TOLERANCE)
    assert not refocus(field, [0.2], RefocusOptions(reduction="deviation")).any()
    exact = refocus(field, [0.2], RefocusOptions(interpolation="fourier"))[0]
    np.testing.assert_allclose(exact, views[1, 1], atol=TOLERANCE)


def test_polygon_of_many_corners_is_a_disc() -> None:
    field = field_of(np.zeros((11, 11, 1, 1, 3)))
    disc = aperture_weights(field, RefocusOptions(radius_views=4.0))
    many = aperture_weights(field, RefocusOptions(aperture="polygon", radius_views=4.0, blades=200))
    np.testing.assert_allclose(many, disc, atol=1e-3)


def test_square_has_its_corners_where_it_is_turned() -> None:
    field = field_of(np.zeros((11, 11, 1, 1, 3)))
    upright = RefocusOptions(aperture="polygon", radius_views=4.0, blades=4)
    turned = RefocusOptions(aperture="polygon", radius_views=4.0, blades=4, turn_rad=np.pi / 4)
    a, b = aperture_weights(field, upright), aperture_weights(field, turned)
    assert a[5, 8] == 1 and a[7, 7] == pytest.approx(0.5, abs=1e-6)
    assert b[5, 8] < 1 and b[7, 7] == 1
    assert b.sum() == pytest.approx(2 * 4.0**2, rel=0.06)  # area of a square of circumradius 4


def test_a_moved_aperture_sees_from_aside() -> None:
    views = np.random.default_rng(5).random((5, 5, 6, 7, 3))
    options = RefocusOptions(radius_views=0.5, centre_views=(2.0, -1.0))
    np.testing.assert_allclose(refocus(field_of(views), [0.0], options)[0], views[1, 4], atol=TOLERANCE)


def test_aperture_from_a_picture(tmp_path: Path) -> None:
    picture = np.zeros((50, 50), np.uint8)
    picture[10:20, 30:40] = 255
    cv2.imwrite(str(tmp_path / "shape.png"), picture)
    field = field_of(np.zeros((5, 5, 1, 1, 3)))
    options = RefocusOptions(aperture="picture", aperture_picture=tmp_path / "shape.png")
    weights = aperture_weights(field, options)
    assert weights[1, 3] == 1 and weights.sum() == 1
    assert blur_ratio(field, 0.1, options) == pytest.approx(0.2 / np.sqrt(np.pi))


@pytest.mark.parametrize(
    "options, message",
    [
        (RefocusOptions(aperture="polygon", blades=2), "blades = 2"),
        (RefocusOptions(aperture="picture"), "found no picture"),
        (RefocusOptions(aperture="picture", aperture_picture=Path("absent.png")), "cannot be read as a picture"),
        (RefocusOptions(centre_views=(40.0, 0.0)), "holds none of the 3 x 3 views"),
        (RefocusOptions(least_weight=1.5), "least_weight = 1.5"),
        (RefocusOptions(interpolation="fourier", tilt=(0.1, 0.0)), "tilt = "),
    ],
)
def test_refuses_options_that_cannot_be(options: RefocusOptions, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        refocus(field_of(np.zeros((3, 3, 4, 4, 3))), [0.0], options)


def test_refuses_a_tilt_that_leaves_the_view() -> None:
    with pytest.raises(InputError, match=r"slope 0\.0 px per view"):
        refocus(field_of(np.zeros((1, 1, 4, 4, 3))), [0.0], RefocusOptions(tilt=(20.0, 0.0)))
