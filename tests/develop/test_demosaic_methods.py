"""What the published demosaics promise: directions along edges, and nothing across the border of a micro-image."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lfstereo.develop.demosaic import malvar2004, opencv_edge_aware
from lfstereo.develop.demosaic_david import david2017
from lfstereo.develop.demosaic_menon import menon2007
from lfstereo.develop.develop import develop
from lfstereo.develop.options import DevelopOptions
from lfstereo.errors import ConfigError
from lfstereo.lenslet.grid import LensletGrid

BAYERS = ["grbg", "rggb", "bggr", "gbrg"]
PITCH = 14.3


def mosaic_of(rgb: np.ndarray, bayer: str) -> np.ndarray:
    out = np.empty(rgb.shape[:2], np.float32)
    for k, name in enumerate(bayer):
        out[k // 2 :: 2, k % 2 :: 2] = rgb[k // 2 :: 2, k % 2 :: 2, "rgb".index(name)]
    return out


@pytest.mark.parametrize("bayer", BAYERS)
@pytest.mark.parametrize("upright", [True, False])
def test_menon_keeps_fine_stripes_along_either_axis(bayer: str, upright: bool) -> None:
    """Grey stripes four px apart: interpolated along them nothing is lost."""
    stripe = 0.5 + 0.3 * np.cos(np.arange(60) * np.pi / 2 + 0.3)
    picture = np.broadcast_to(stripe[None, :, None] if upright else stripe[:, None, None], (60, 60, 3))
    mosaic = mosaic_of(picture.astype(np.float32), bayer)
    inner = (slice(6, -6), slice(6, -6))
    assert np.abs(menon2007(mosaic, bayer) - picture)[inner].max() < 1e-5
    assert np.abs(malvar2004(mosaic, bayer) - picture)[inner].max() > 0.02


@pytest.mark.parametrize("bayer", BAYERS)
def test_opencv_knows_the_sites(bayer: str) -> None:
    colour = np.broadcast_to(np.array([0.1, 0.4, 0.8], np.float32), (20, 20, 3))
    assert opencv_edge_aware(mosaic_of(colour, bayer), bayer)[8, 8] == pytest.approx([0.1, 0.4, 0.8], abs=2e-5)


def lenslets(shifted: int = 1) -> LensletGrid:
    down = PITCH * np.sqrt(3) / 2
    return LensletGrid((8.3, 8.6), (PITCH, 0.0), (0.0, down), shifted, 8, 8, (120, 140), 0.0, 1.0, "given")


def own_lenslet(grid: LensletGrid) -> np.ndarray:
    """Return for each px the row and column of the nearest lenslet, by trying them all."""
    y, x = np.mgrid[:120, :140]
    centres = grid.centres().reshape(-1, 2)
    return np.argmin((x[..., None] - centres[:, 0]) ** 2 + (y[..., None] - centres[:, 1]) ** 2, axis=-1)


@pytest.mark.parametrize("bayer", BAYERS)
@pytest.mark.parametrize("shifted", [0, 1])
def test_david_takes_nothing_from_the_next_lenslet(bayer: str, shifted: int) -> None:
    """Every lenslet of another even grey: each px keeps its own lenslet's, up to the border."""
    grid = lenslets(shifted)
    tones = np.random.default_rng(4).uniform(0.1, 0.9, grid.rows * grid.columns).astype(np.float32)
    picture = np.repeat(tones[own_lenslet(grid)][..., None], 3, axis=2)
    found = david2017(mosaic_of(picture, bayer), bayer, np.ones((120, 140), np.float32), grid)
    inner = (slice(10, 90), slice(10, 110))
    own = np.abs(found - picture)[inner]
    assert np.percentile(own, 99.5) < 1e-5  # a lenslet's corner px may have no neighbour of a colour
    assert np.percentile(np.abs(malvar2004(mosaic_of(picture, bayer), bayer) - picture)[inner], 90) > 0.02


def test_david_needs_a_grid(draw_frame: Callable[..., Any]) -> None:
    photo = draw_frame(shape=(120, 140)).capture
    with pytest.raises(ConfigError, match="found david2017 without a lenslet grid"):
        develop(photo, np.ones((120, 140), np.float32), DevelopOptions(demosaic="david2017"))
    found = develop(photo, np.ones((120, 140), np.float32), DevelopOptions(demosaic="david2017"), grid=lenslets())
    assert found.shape == (120, 140, 3)
