"""Mosaics squeezed through JPEG: what the file allows, and what is known of the light."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image
from scipy.fft import dctn

from lfstereo.container.jpeg_mosaic import restore_mosaic

BLACK = 10.0
WHITE_OF_SITES = (0.68, 1.0, 1.0, 0.99)
"""Of the sites b, g, g, r."""


def squeezed(mosaic: np.ndarray, quality: int = 75) -> tuple[np.ndarray, np.ndarray]:
    """Return the mosaic as it comes out of a JPEG, and the steps of the file."""
    data = io.BytesIO()
    Image.fromarray(np.rint(mosaic).astype(np.uint8)).save(data, "JPEG", quality=quality)
    picture = Image.open(data)
    return np.array(picture), np.reshape(picture.quantization[0], (8, 8))


def patch(level: float, sites: tuple[float, ...], shape: tuple[int, int] = (96, 120)) -> np.ndarray:
    """Return an evenly lit mosaic with a little texture."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    light = level * (1 + 0.1 * np.sin(x / 3.1 + y / 4.7))
    return BLACK + light * np.tile(np.reshape(sites, (2, 2)), (shape[0] // 2, shape[1] // 2))


def site_means(mosaic: np.ndarray) -> np.ndarray:
    means = np.array([mosaic[16 + k // 2 : -16 : 2, 16 + k % 2 : -16 : 2].mean() - BLACK for k in range(4)])
    return means / means[1:3].mean()


def test_dim_grey_gets_the_pattern_of_white_light_back() -> None:
    lost, steps = squeezed(patch(25.0, WHITE_OF_SITES))
    assert site_means(lost)[0] > 0.9  # blue has become as bright as green
    found = restore_mosaic(lost, steps, BLACK, WHITE_OF_SITES)
    assert site_means(found) == pytest.approx(WHITE_OF_SITES, abs=0.05)


def test_strong_colour_that_the_file_tells_is_kept() -> None:
    red = (0.25, 0.4, 0.4, 1.0)
    lost, steps = squeezed(patch(180.0, red))
    found = restore_mosaic(lost, steps, BLACK, WHITE_OF_SITES)
    assert site_means(found) == pytest.approx(np.divide(red, 0.4), rel=0.1)


def test_the_same_file_would_have_been_stored() -> None:
    rng = np.random.default_rng(0)
    lost, steps = squeezed(np.clip(patch(70.0, (0.5, 1.0, 1.0, 0.8)) + rng.normal(0, 6, (96, 120)), 20, 235))
    found = restore_mosaic(lost, steps, BLACK, WHITE_OF_SITES)

    def coefficients(mosaic: np.ndarray) -> np.ndarray:
        blocks = (mosaic.astype(float) - 128).reshape(12, 8, 15, 8).transpose(0, 2, 1, 3)
        return np.asarray(dctn(blocks, axes=(2, 3), norm="ortho"))

    told = np.rint(coefficients(lost) / steps) * steps
    assert (np.abs(coefficients(found) - told) <= steps / 2 + 1e-3).all()
    assert np.abs(found - lost).max() > 3  # and yet another mosaic


def test_a_file_that_lost_nothing_is_left_alone() -> None:
    rng = np.random.default_rng(1)
    kept, steps = squeezed(rng.integers(20, 230, (96, 120)), quality=100)
    assert (
        np.abs(restore_mosaic(kept, steps, BLACK, WHITE_OF_SITES) - kept).max() < 4
    )  # 64 coefficients, half a step each


def test_sides_that_no_block_divides() -> None:
    lost, steps = squeezed(patch(25.0, WHITE_OF_SITES, (90, 102)))
    found = restore_mosaic(lost, steps, BLACK, WHITE_OF_SITES)
    assert found.shape == (90, 102)
    assert site_means(found) == pytest.approx(WHITE_OF_SITES, abs=0.05)
