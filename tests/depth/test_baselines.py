"""Semi-global matching of random dots, scores and the colour scale."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lfstereo.depth.baselines import BaselineOptions, fill_from_background, sgbm, sgbm_wls
from lfstereo.depth.colormap import DisparityScale, colour_disparity, picture_disparity, round_ticks
from lfstereo.depth.disparity import DisparityMap
from lfstereo.depth.metrics import score_disparity
from lfstereo.errors import ConfigError, InputError, ShapeError

MEDIAN_PX = 0.1


def random_dots(near_px: float = 24.0, far_px: float = 7.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A near square before a far wall; ``x_right = x_left - d``. Returns left, right and the left disparity."""
    rng = np.random.default_rng(0)
    rows, columns = 120, 220
    dots = cv2.GaussianBlur(rng.random((2, rows, columns + 60, 3)).astype(np.float32)[0], (0, 0), 0.8)
    front = cv2.GaussianBlur(rng.random((rows, columns + 60, 3)).astype(np.float32), (0, 0), 0.8)
    y, x = np.mgrid[:rows, :columns].astype(np.float32)

    def seen(x_left_of_wall: np.ndarray, x_left_of_square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        wall = cv2.remap(dots, x_left_of_wall, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        square = cv2.remap(front, x_left_of_square, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        on_square = (x_left_of_square > 90) & (x_left_of_square < 160) & (y > 30) & (y < 90)
        return np.clip(np.where(on_square[..., None], square, wall), 0, 1), on_square

    left, on_square = seen(x, x)
    right, _ = seen(x + np.float32(far_px), x + np.float32(near_px))
    return left, right, np.where(on_square, near_px, far_px).astype(np.float32)


@pytest.mark.parametrize("match", [sgbm, sgbm_wls])
def test_finds_random_dots(match) -> None:
    left, right, truth = random_dots()
    found = match(left, right, 30.0)
    scores = score_disparity(found.disparity, truth, np.ones_like(found.valid), found.valid)
    error = np.abs(found.disparity - truth)[found.valid]
    assert np.median(error) < MEDIAN_PX
    assert scores.density > 75.0
    filled = fill_from_background(found)
    assert filled.valid.all()
    assert np.abs(filled.disparity - truth)[:, -4:].max() < 1.0  # px: at the right border blocks leave the picture
    assert score_disparity(filled.disparity, truth, filled.valid).bad_2 < 8.0


def test_search_may_start_above_zero() -> None:
    left, right, truth = random_dots()
    found = sgbm(left, right, 30.0, 5.0)
    assert np.median(np.abs(found.disparity - truth)[found.valid]) < MEDIAN_PX


def test_holes_take_the_background() -> None:
    valid = np.array([[False, False, False, False], [False, True, False, True], [False, False, False, False]])
    disparity = np.float32([[0] * 4, [0, 3, 0, 8], [0] * 4])
    filled = fill_from_background(DisparityMap(disparity, valid, np.zeros((3, 4, 3), np.float32)))
    assert filled.disparity.tolist() == [[3, 3, 3, 8]] * 3


def test_refuses_to_fill_from_nothing() -> None:
    nothing = DisparityMap(np.zeros((2, 2), np.float32), np.zeros((2, 2), np.bool_), np.zeros((2, 2, 3), np.float32))
    with pytest.raises(ShapeError, match="no pixel is valid"):
        fill_from_background(nothing)


@pytest.mark.parametrize("d_max, d_min", [(5.0, 5.0), (np.nan, 0.0), (9.0, -3.0)])
def test_refuses_an_empty_search(d_max: float, d_min: float) -> None:
    with pytest.raises(ConfigError, match="disparities to search"):
        sgbm(np.zeros((20, 60, 3), np.float32), np.zeros((20, 60, 3), np.float32), d_max, d_min)


@pytest.mark.parametrize("block", [0, 4])
def test_refuses_an_even_block(block: int) -> None:
    views = np.zeros((20, 60, 3), np.float32)
    with pytest.raises(ConfigError, match="block_px"):
        sgbm_wls(views, views, 8.0, options=BaselineOptions(block_px=block))


def test_refuses_views_of_two_sizes() -> None:
    with pytest.raises(ShapeError, match="rectified views: found shapes"):
        sgbm(np.zeros((20, 60, 3), np.float32), np.zeros((20, 61, 3), np.float32), 8.0)


@pytest.mark.parametrize("shapes", [((4,), (4,), (4, 3)), ((4, 5), (4, 4), (4, 5, 3)), ((4, 5), (4, 5), (4, 5))])
def test_a_disparity_map_keeps_one_size(shapes: tuple[tuple[int, ...], ...]) -> None:
    with pytest.raises(ShapeError, match="disparity: found an array of shape"):
        DisparityMap(np.zeros(shapes[0], np.float32), np.zeros(shapes[1], np.bool_), np.zeros(shapes[2], np.float32))


def test_scores_of_known_errors() -> None:
    truth = np.full((1, 10), 20.0, np.float32)
    found = truth + np.float32([[0, 0.4, 0.6, -0.9, 1.1, -1.9, 2.1, 3.9, -4.1, 50.0]])
    known = np.ones((1, 10), np.bool_)
    answered = known.copy()
    answered[0, 9] = False
    scores = score_disparity(found, truth, known, answered)
    errors = np.array([0, 0.4, 0.6, 0.9, 1.1, 1.9, 2.1, 3.9, 4.1])
    assert scores.mae_px == pytest.approx(errors.mean(), abs=1e-5)
    assert scores.rmse_px == pytest.approx(np.sqrt(np.mean(errors**2)), abs=1e-5)
    ninth = 100 / 9
    bad = (scores.bad_05, scores.bad_1, scores.bad_2, scores.bad_4)
    assert bad == pytest.approx((7 * ninth, 5 * ninth, 3 * ninth, ninth))
    assert scores.density == pytest.approx(90.0) and scores.pixels == 10


def test_scores_refuse_what_cannot_be_judged() -> None:
    zeros, no = np.zeros((2, 2), np.float32), np.zeros((2, 2), np.bool_)
    with pytest.raises(ShapeError, match="truth: found shape"):
        score_disparity(zeros, zeros[:1], ~no)
    with pytest.raises(ShapeError, match="estimate_valid: found shape"):
        score_disparity(zeros, zeros, ~no, no[:1])
    with pytest.raises(InputError, match="no pixel has both"):
        score_disparity(zeros, zeros, ~no, no)
    with pytest.raises(InputError, match="not finite"):
        score_disparity(zeros + np.float32(np.inf), zeros, ~no)


def test_colours_run_from_cold_to_warm_and_show_what_is_unknown() -> None:
    disparity = np.linspace(0, 100, 101, dtype=np.float32)[None]
    valid = disparity != 50
    colours = colour_disparity(disparity, valid, DisparityScale(100.0))
    red, blue = colours[0, 95].astype(int), colours[0, 10].astype(int)
    assert red[0] > 2 * red[2] and blue[2] > 2 * blue[0] - 20
    assert len(set(colours[0, 50].tolist())) == 1
    np.testing.assert_array_equal(
        colour_disparity(np.float32([[-5.0, 500.0]]), None, DisparityScale(100.0))[0], colours[0, [0, 100]]
    )


def test_picture_holds_the_colours_and_a_scale_in_metres() -> None:
    disparity = np.random.default_rng(0).uniform(0, 92, (120, 40)).astype(np.float32)
    px_alone = picture_disparity(disparity, None, DisparityScale(92.0))
    metric = picture_disparity(disparity, None, DisparityScale(92.0, 0.0, 1156.0, 0.095, 90.0))
    behind_infinity = picture_disparity(disparity, None, DisparityScale(92.0, 0.0, 1156.0, 0.095, -20.0))
    np.testing.assert_array_equal(metric[:, :40], colour_disparity(disparity, None, DisparityScale(92.0)))
    assert px_alone.shape == metric.shape == behind_infinity.shape
    dark = [int((p[:, 40:].min(axis=-1) < 100).sum()) for p in (px_alone, metric)]
    assert dark[1] > dark[0]


@pytest.mark.parametrize(
    "low, high, most, expected",
    [
        (0.0, 100.0, 11, [10.0 * n for n in range(11)]),
        (-3.1, 2.7, 6, [-3, -2, -1, 0, 1, 2]),
        (0.2, 0.3, 3, [0.2, 0.25, 0.3]),
    ],
)
def test_ticks_are_round(low: float, high: float, most: int, expected: list[float]) -> None:
    assert round_ticks(low, high, most) == pytest.approx(expected)


def test_colour_scale_refuses_an_empty_range_and_other_shapes() -> None:
    with pytest.raises(InputError, match="colour scale"):
        DisparityScale(1.0, 1.0)
    with pytest.raises(ShapeError, match="valid: found shape"):
        colour_disparity(np.zeros((2, 2), np.float32), np.ones((1, 2), np.bool_), DisparityScale(1.0))
    with pytest.raises(ShapeError, match="disparity: found an array"):
        picture_disparity(np.zeros(2, np.float32), None, DisparityScale(1.0))
