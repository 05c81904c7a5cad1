"""Rendered scenes: exact disparity, exact views, textures from seeds."""

import cv2
import numpy as np
import pytest

from lfstereo.training.layers import Column
from lfstereo.training.scenes import Scene, random_scene, render
from lfstereo.training.textures import KINDS, octave_noise, texture_bank

HEIGHT, WIDTH = 64, 128
DISPARITY_PX = 2e-3
COLOUR = 0.02  # linear, of textures in 0 to 1, after one bilinear interpolation


@pytest.fixture(scope="module")
def bank() -> np.ndarray:
    return texture_bank(5, 6)


def plane(d: float, slope_x: float = 0.0, slope_y: float = 0.0) -> np.ndarray:
    row = np.zeros(Column.COUNT, np.float32)
    row[[Column.CX, Column.CY, Column.HALF_W, Column.HALF_H, Column.COS]] = WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT, 1
    row[[Column.D, Column.D_X, Column.D_Y, Column.TEX_COS]] = d, slope_x, slope_y, 0.4
    row[Column.GAIN : Column.GAIN + 3] = 1.0
    return row


def test_same_seed_same_scene(bank: np.ndarray) -> None:
    a, b = (random_scene(np.random.default_rng(3), bank, HEIGHT, WIDTH) for _ in range(2))
    other = random_scene(np.random.default_rng(4), bank, HEIGHT, WIDTH)
    np.testing.assert_array_equal(a.layers, b.layers)
    assert not np.array_equal(a.layers[:5], other.layers[:5])
    assert 9 <= len(a.layers) <= 31


@pytest.mark.parametrize("seed", range(6))
def test_disparity_agrees_between_the_eyes(bank: np.ndarray, seed: int) -> None:
    """At ``x - d`` the right eye sees the same layer at the same disparity, wherever the point is not hidden."""
    scene = random_scene(np.random.default_rng(seed), bank, HEIGHT, WIDTH)
    left, right = render(scene, 0, 0), render(scene, 1, 0)
    x = (np.arange(WIDTH)[None] - left.disparity).astype(np.float32)
    y = np.repeat(np.arange(HEIGHT, dtype=np.float32)[:, None], WIDTH, 1)
    inside = x >= 1
    seen = cv2.remap(right.disparity, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    layers = [
        cv2.remap(right.layer, np.clip(np.floor(x) + k, 0, WIDTH - 1), y, cv2.INTER_NEAREST) == left.layer
        for k in (-1, 0, 1, 2)
    ]
    same = inside & layers[0] & layers[1] & layers[2] & layers[3]
    assert same.mean() > 0.05
    curved = scene.layers[:, [Column.BUMP, Column.RIPPLE]].any(1)[left.layer.astype(int)]
    error = np.abs(seen - left.disparity)
    assert error[same & ~curved].max(initial=0) < DISPARITY_PX
    assert error[same & curved].max(initial=0) < 0.1  # px; a curved surface is interpolated linearly here
    # Elsewhere the right eye sees something nearer in front of the point, or the frame or an edge is close.
    hidden = inside & ~(layers[0] | layers[1] | layers[2] | layers[3])
    assert (seen[hidden] > left.disparity[hidden]).mean() > 0.95
    assert left.disparity.min() > -1 and left.disparity.max() < 105


def test_slanted_plane_has_its_closed_form(bank: np.ndarray) -> None:
    scene = Scene(plane(30.0, 0.1, 0.05)[None], bank, HEIGHT, WIDTH)
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    d = 30 + 0.1 * (x - WIDTH / 2) + 0.05 * (y - HEIGHT / 2)
    np.testing.assert_allclose(render(scene, 0, 0).disparity, d, atol=DISPARITY_PX)
    np.testing.assert_allclose(render(scene, 1, 0).disparity, d / 0.9, atol=DISPARITY_PX)
    np.testing.assert_allclose(render(scene, 0, 1).disparity, d / 0.95, atol=DISPARITY_PX)


def test_curved_surface_meets_its_own_equation(bank: np.ndarray) -> None:
    row = plane(40.0, 0.05)
    row[[Column.BUMP, Column.RIPPLE, Column.WAVE_X, Column.PHASE]] = 6.0, 2.0, 0.06, 0.4
    d = render(Scene(row[None], bank, HEIGHT, WIDTH), 1, 0).disparity
    dx = np.arange(WIDTH)[None] + d - WIDTH / 2
    dy = np.arange(HEIGHT)[:, None] - HEIGHT / 2
    round_off = 6.0 / (WIDTH**2 + HEIGHT**2) * (dx**2 + dy**2)
    np.testing.assert_allclose(d, 40 + 0.05 * dx - round_off + 2 * np.sin(0.06 * dx + 0.4), atol=DISPARITY_PX)


def test_colours_move_by_the_disparity(bank: np.ndarray) -> None:
    scene = Scene(plane(12.0)[None], bank, HEIGHT, WIDTH)
    left, right = render(scene, 0, 0).image, render(scene, 1, 0).image
    np.testing.assert_allclose(left[:, 12:], right[:, :-12], atol=COLOUR)


def test_margin_and_shift_only_move_the_frame(bank: np.ndarray) -> None:
    scene = random_scene(np.random.default_rng(8), bank, HEIGHT, WIDTH)
    plain, wide = render(scene, 0.3, 0.1), render(scene, 0.3, 0.1, margin=5)
    lower = render(scene, 0.3, 0.1, shift_y=2.0)
    np.testing.assert_allclose(wide.image[5:-5, 5:-5], plain.image, atol=2e-3)
    np.testing.assert_allclose(lower.image[2:], plain.image[:-2], atol=2e-3)


def test_supersampling_keeps_the_mean_and_the_disparity(bank: np.ndarray) -> None:
    scene = random_scene(np.random.default_rng(9), bank, HEIGHT, WIDTH)
    one, four = render(scene, 0, 0), render(scene, 0, 0, samples=4)
    np.testing.assert_array_equal(one.disparity, four.disparity)
    assert abs(float(one.image.mean() - four.image.mean())) < 0.005


def test_texture_bank_is_seeded_seamless_and_linear() -> None:
    a, b, c = texture_bank(1, 4), texture_bank(1, 4), texture_bank(2, 4)
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    assert a.shape == (4, 256, 256, 3) and a.dtype == np.float32
    assert a.min() >= 0 and a.max() <= 1
    assert sum(KINDS.values()) == pytest.approx(1.0)


def test_octave_noise_repeats_without_a_seam() -> None:
    noise = octave_noise(np.random.default_rng(0), 4, 2, 0.5)
    seam = np.abs(noise[:, 0] - noise[:, -1]).mean()
    assert seam < 3 * np.abs(np.diff(noise, axis=1)).mean()
