"""Views from Bayer samples: what must come out exactly, and what must not leak in."""

from __future__ import annotations

import numpy as np
import pytest

from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield.fine_rows import PHASES, fine_weights
from lfstereo.lightfield.micro_images import MicroImages, micro_image_operator, micro_image_operators

PITCH = 14.3
BAYERS = ["grbg", "rggb", "bggr", "gbrg"]
STEPS = np.arange(-7, 8) * 0.884
OFFSETS = np.stack(np.meshgrid(STEPS, STEPS), axis=-1).reshape(-1, 2)
OFFSETS = OFFSETS[np.hypot(*OFFSETS.T) < 7.1 * 0.884]
PRINCIPAL = np.eye(3)


def lenslets(rows: int = 8, columns: int = 8) -> LensletGrid:
    down = PITCH * np.sqrt(3) / 2
    return LensletGrid((12.3, 11.6), (PITCH, 0.0), (0.0, down), 1, rows, columns, (128, 140), 0.0, 1.0, "given")


def mosaic_of(rgb: np.ndarray, bayer: str) -> np.ndarray:
    out = np.empty(rgb.shape[:2], np.float32)
    for k, name in enumerate(bayer):
        out[k // 2 :: 2, k % 2 :: 2] = rgb[k // 2 :: 2, k % 2 :: 2, "rgb".index(name)]
    return out


def views_of(picture: np.ndarray, bayer: str, grid: LensletGrid, **changes: np.ndarray) -> np.ndarray:
    """Return ``(rows, columns, N, 3)`` of a picture that has all colours on every pixel of the sensor."""
    mosaic = changes["mosaic"] if "mosaic" in changes else mosaic_of(picture, bayer)
    shading = changes.get("shading", np.ones(mosaic.shape, np.float32))
    operators = micro_image_operators(grid, OFFSETS, bayer, changes.get("matrix", PRINCIPAL))
    read = MicroImages(mosaic, shading, grid.centres(), operators)
    values = np.empty((grid.rows * grid.columns, 3 * len(OFFSETS)), np.float32)
    places = read(0, grid.rows, values)
    return values[places].reshape(grid.rows, grid.columns, -1, 3)


def place_in_lenslet(grid: LensletGrid) -> tuple[np.ndarray, np.ndarray]:
    """Return for each px the number of the nearest lenslet and the offset (x, y) from it, by trying them all."""
    y, x = np.mgrid[: grid.sensor_shape[0], : grid.sensor_shape[1]]
    centres = grid.centres().reshape(-1, 2)
    own = np.argmin((x[..., None] - centres[:, 0]) ** 2 + (y[..., None] - centres[:, 1]) ** 2, axis=-1)
    return own, np.stack([x, y], -1) - centres[own]


@pytest.mark.parametrize("bayer", BAYERS)
def test_even_colours_come_out_exactly_whatever_the_next_lenslet_shows(bayer: str) -> None:
    grid = lenslets()
    own, _ = place_in_lenslet(grid)
    colours = np.random.default_rng(2).uniform(0.1, 0.9, (grid.rows * grid.columns, 3)).astype(np.float32)
    found = views_of(colours[own], bayer, grid)
    inner = (slice(1, -1), slice(1, -1))
    expected = colours.reshape(grid.rows, grid.columns, 1, 3)
    assert np.abs(found - expected)[inner].max() < 1e-4


@pytest.mark.parametrize("bayer", BAYERS)
def test_grey_detail_is_seen_at_the_views_offsets_up_to_the_rim(bayer: str) -> None:
    """A grey wave of six px, another phase in each lenslet."""
    grid = lenslets()
    own, offset = place_in_lenslet(grid)
    phase = np.random.default_rng(3).uniform(0, 6.28, grid.rows * grid.columns)

    def wave(x: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return 0.5 + 0.2 * np.sin(0.9 * x + 0.5 * y + p)

    grey = wave(offset[..., 0], offset[..., 1], phase[own])
    found = views_of(np.repeat(grey[..., None], 3, axis=2), bayer, grid)[1:-1, 1:-1]
    expected = wave(OFFSETS[:, 0], OFFSETS[:, 1], phase[:, None]).reshape(grid.rows, grid.columns, -1)[1:-1, 1:-1]
    error = np.abs(found - expected[..., None])
    near = np.hypot(*OFFSETS.T) < 5.2 * 0.884
    # A phase of the operators is up to 1/16 px off per axis, the wave's slope is up to 0.2 per px: 0.013 at most.
    assert np.sqrt(np.mean(error[:, :, near] ** 2)) < 0.009
    assert np.sqrt(np.mean(error**2)) < 0.015


def test_the_colour_matrix_is_applied() -> None:
    grid = lenslets(4, 4)
    matrix = np.array([[1.5, -0.4, -0.1], [-0.2, 1.3, -0.1], [0.0, -0.5, 1.5]])
    colour = np.array([0.2, 0.5, 0.3], np.float32)
    found = views_of(np.broadcast_to(colour, (128, 140, 3)), "grbg", grid, matrix=matrix)
    assert np.abs(found - matrix @ colour).max() < 1e-4


def test_unlit_pixels_do_not_count() -> None:
    """Where a micro-image is cut off by the main lens, nonsense stands in the mosaic; the lit side must not see it."""
    grid = lenslets()
    _, offset = place_in_lenslet(grid)
    dark = offset[..., 0] > 4.5
    mosaic = np.where(dark, 5.0, 0.4).astype(np.float32)
    shading = np.where(dark, 0.02, 1.0).astype(np.float32)
    found = views_of(np.empty(0), "grbg", grid, mosaic=mosaic, shading=shading)
    lit = OFFSETS[:, 0] < 4.0
    assert np.abs(found[:, 1:-1, lit] - 0.4).max() < 1e-3


def test_lenslets_beyond_the_sensor_take_its_border() -> None:
    grid = LensletGrid((-9.0, -6.0), (PITCH, 0.0), (0.0, 12.4), 0, 13, 12, (128, 140), 0.0, 1.0, "given")
    colour = np.array([0.2, 0.5, 0.3], np.float32)
    found = views_of(np.broadcast_to(colour, (128, 140, 3)), "grbg", grid)
    assert np.abs(found - colour).max() < 1e-4


def test_weights_of_even_light_sum_to_one() -> None:
    operator = micro_image_operator(np.array([0.7, 1.3]), OFFSETS, PITCH, 0.002, "grbg", PRINCIPAL)
    assert len(operator.pixels) == len(operator.inner) == len(operator.weights)
    assert np.hypot(*(operator.pixels - [0.7, 1.3]).T).max() < PITCH / 2
    assert np.allclose(operator.weights.sum(0), 1, atol=1e-4)
    # A view takes most from where it lies.
    views = operator.weights.reshape(-1, len(OFFSETS), 3)[:, :, 1]
    centre = operator.pixels[np.abs(views).argmax(0)] - [0.7, 1.3] - OFFSETS
    assert np.median(np.hypot(*centre.T)) < 1.0


@pytest.mark.parametrize("upsampling", [1, 2, 3])
def test_barycentric_weights_keep_planes(upsampling: int) -> None:
    table = fine_weights("barycentric", upsampling)
    assert table.min() > -1e-6 and np.allclose(table.sum(-1), 1, atol=1e-5)
    for j, half in np.ndindex(upsampling, 2):
        along = [[0 if row % 2 == 0 else half - 0.5, row] for row in (-1, 0, 1, 2) for _ in range(4)]
        x = np.array([base + k - 1 for (base, _), k in zip(along, np.tile(np.arange(4), 4), strict=True)])
        y = np.array([row for _, row in along])
        assert np.allclose(table[j, half] @ x, 0.5 * (half + np.arange(PHASES + 1) / PHASES), atol=1e-5)
        assert np.allclose(table[j, half] @ y, j / upsampling, atol=1e-5)
