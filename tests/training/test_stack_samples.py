"""Focal stacks of rendered scenes: sharp where they should be, blur linear in the disparity, faults of real cameras."""

import numpy as np
import pytest

from lfstereo.training import samples
from lfstereo.training.layers import Column
from lfstereo.training.samples import (
    PUPIL_POINTS,
    SLICE_DISPARITIES,
    pair_sample,
    pupil_points,
    stack_sample,
)
from lfstereo.training.scenes import Scene, render
from lfstereo.training.textures import texture_bank
from lfstereo.training.tracing import shear_add

HEIGHT, WIDTH = 48, 96


@pytest.fixture(scope="module")
def bank() -> np.ndarray:
    return texture_bank(6, 6)


def test_pupil_points_cover_the_disc() -> None:
    points = pupil_points(400)
    assert np.abs(points.mean(0)).max() < 1e-6
    radius = np.hypot(*points.T)
    assert radius.max() < 1.01
    assert np.mean(radius**2) == pytest.approx(0.5, abs=0.01)  # a uniform disc of radius 1


def test_shear_add_is_a_subpixel_shift() -> None:
    x = np.arange(20 + 8, dtype=np.float32)
    view = np.broadcast_to(x[None, :, None], (10 + 8, 28, 3)).copy()
    total = np.zeros((1, 10, 20, 3), np.float32)
    shear_add(view, np.float32([1.25]), np.float32([-0.5]), 4, total)
    np.testing.assert_allclose(total[0, 3, :, 1], np.arange(20) + 4 - 1.25, atol=1e-5)


def test_blur_is_linear_in_the_disparity_from_the_focus() -> None:
    """A white point on black: the spread over the slices is ``a |d - d_k|`` in diameter."""
    ratio, d = 0.2, 40.0
    row = np.zeros(Column.COUNT, np.float32)
    row[[Column.CX, Column.CY, Column.HALF_W, Column.HALF_H, Column.COS]] = WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT, 1
    row[[Column.D, Column.TEX_COS, Column.GAIN]] = d, 1.0, 1.0
    texture = np.zeros((1, 256, 256, 3), np.float32)
    texture[0, 0, 0] = 1.0
    scene = Scene(row[None], texture, HEIGHT, WIDTH)
    points = pupil_points(PUPIL_POINTS) * (ratio / 2)
    total = np.zeros((16, HEIGHT, WIDTH, 3), np.float32)
    for x, y in points:
        view = render(scene, float(x), float(y), margin=14).image
        shear_add(view, SLICE_DISPARITIES * x, SLICE_DISPARITIES * y, 14, total)
    grey = total[..., 0] / len(points)
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    for k, focus in enumerate(SLICE_DISPARITIES):
        mass = grey[k].sum()
        variance = (grey[k] * ((columns - WIDTH / 2) ** 2 + (rows - HEIGHT / 2) ** 2)).sum() / mass
        expected = (ratio * abs(d - focus) / 2) ** 2 / 2  # a disc: mean squared radius is half the radius squared
        assert mass == pytest.approx(1.0, abs=1e-3)
        assert variance == pytest.approx(
            expected, rel=0.03, abs=0.8
        )  # px^2; two bilinear interpolations spread a point


def test_stack_is_sharpest_at_its_own_disparity(bank: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    row = np.zeros(Column.COUNT, np.float32)
    row[[Column.CX, Column.CY, Column.HALF_W, Column.HALF_H, Column.COS]] = WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT, 1
    row[[Column.D, Column.TEX_COS]] = SLICE_DISPARITIES[5], 1.0
    row[Column.GAIN : Column.GAIN + 3] = 1.0
    noise = np.random.default_rng(0).random((1, 256, 256, 3), dtype=np.float32)
    monkeypatch.setitem(samples.SCENES, "layers", lambda *_: Scene(row[None], noise, HEIGHT, WIDTH))
    sample = stack_sample(np.random.default_rng(1), noise, HEIGHT, WIDTH, aperture_ratio=0.3)
    for eye in (0, 1):
        lit = sample.valid[eye]
        contrast = [slice_[lit].std() for slice_ in sample.stacks[eye]]
        assert int(np.argmax(contrast)) == 5
        assert np.abs(sample.stacks[eye, 5] - sample.sharp[eye])[lit].mean() < 0.08
    np.testing.assert_allclose(sample.disparity, SLICE_DISPARITIES[5], atol=1e-3)


def test_samples_are_seeded_and_in_range(bank: np.ndarray) -> None:
    a, b = (stack_sample(np.random.default_rng(7), bank, HEIGHT, WIDTH) for _ in range(2))
    np.testing.assert_array_equal(a.stacks, b.stacks)
    assert a.stacks.shape == (2, 16, HEIGHT, WIDTH, 3)
    assert a.stacks.min() >= 0 and a.stacks.max() <= 1
    assert 0.05 <= a.aperture_ratio <= 0.4
    pair = pair_sample(np.random.default_rng(7), bank, HEIGHT, WIDTH)
    assert pair.left.shape == pair.right.shape == (HEIGHT, WIDTH, 3)
    assert pair.left.dtype == pair.disparity.dtype == np.float32


def test_black_margins_are_not_valid(bank: np.ndarray) -> None:
    found = 0
    for seed in range(12):
        pair = pair_sample(np.random.default_rng(seed), bank, HEIGHT, WIDTH)
        assert (pair.left[~pair.valid] == 0).all()
        found += not pair.valid.all()
    assert 0 < found < 12
