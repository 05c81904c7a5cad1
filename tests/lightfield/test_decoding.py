"""Decoded views against the scene they were drawn from."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.container import Capture
from lfstereo.container.mosaic_image import read_mosaic_image
from lfstereo.container.packing import unpack
from lfstereo.errors import AssetError, ConfigError, GridFitError
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lightfield import DecodeOptions, LightField, decode
from lfstereo.lightfield.decoding import view_count
from lfstereo.lightfield.fine_rows import Interpolation
from lfstereo.lightfield.hexagons import PHASES, hexagon_weights
from lfstereo.lightfield.options import ViewOptions
from lfstereo.lightfield.resample import LensletImage, offsets_inside, sample_views, view_columns, view_sampling
from lfstereo.progress import silent

PARALLAX = 3.5
"""Px on the lattice per px inside the micro-image: slope 3.5 * 0.884 / 12.38 = 0.25 view px per view."""


def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 + 0.2 * np.sin(x / 13 + 0.3) * np.cos(y / 17) + 0.15 * np.sin((x - 2 * y) / 29)


def view_positions(light_field: LightField) -> tuple[np.ndarray, np.ndarray]:
    """Return where the pixels of the centre view lie on the sensor, by the light field's own sampling."""
    assert light_field.sampling is not None
    s = light_field.sampling
    v, u = np.mgrid[: light_field.views.shape[2], : light_field.views.shape[3]]
    cos, sin = np.cos(s.rotation_rad), np.sin(s.rotation_rad)
    x = s.origin_px[0] + cos * u * s.step_px[0] - sin * v * s.step_px[1]
    y = s.origin_px[1] + sin * u * s.step_px[0] + cos * v * s.step_px[1]
    return x, y


@pytest.fixture(scope="module")
def white(draw_frame: Callable[..., Any]) -> Capture:
    found: Capture = draw_frame(noise=0.5).capture
    return found


@pytest.fixture(scope="module")
def decoded(draw_frame: Callable[..., Any], white: Capture) -> LightField:
    return decode(draw_frame(scene=texture, parallax=PARALLAX, noise=0.5).capture, white)


def test_every_view_shows_the_scene_where_the_conventions_put_it(decoded: LightField) -> None:
    x, y = view_positions(decoded)
    inner = (slice(2, -2), slice(2, -2))
    full = 700 / (1023 - 64)
    for t, s in ((7, 7), (7, 2), (12, 7), (3, 10), (10, 11)):
        # A view further to +x sees what lies at lattice x + parallax * offset: a near point moves to -x.
        dx, dy = (s - 7) * 0.884, (t - 7) * 0.884
        expected = texture(x + PARALLAX * dx, y + PARALLAX * dy)
        assert decoded.weight is not None
        lit = (decoded.weight[t, s] > 100)[inner]
        found = decoded.views[t, s, ..., 1][inner] / full
        assert np.sqrt(np.mean((found - expected[inner])[lit] ** 2)) < 0.015
        wrong_way = texture(x - PARALLAX * dx, y - PARALLAX * dy)[inner]
        if (t, s) != (7, 7):
            assert np.sqrt(np.mean((found - wrong_way)[lit] ** 2)) > 0.08


def test_colours_of_a_grey_scene_agree(decoded: LightField) -> None:
    centre = decoded.views[7, 7, 2:-2, 2:-2]
    assert np.abs(centre - centre.mean(-1, keepdims=True)).mean() < 0.004
    assert np.ptp(centre.mean((0, 1))) < 0.004


def test_shape_type_and_dark_corners(decoded: LightField) -> None:
    assert decoded.views.shape == (15, 15, 32, 36, 3)  # 400/12.38 rows, ceil(31 * 1.1547) columns
    assert decoded.views.dtype == np.float32
    assert decoded.views.min() >= 0
    assert decoded.weight is not None
    assert decoded.weight[7, 7, 3:-3, 3:-3].min() > 240
    for t, s in ((0, 0), (0, 14), (14, 0), (14, 14)):
        assert decoded.weight[t, s].max() == 0
        assert decoded.views[t, s].max() == 0
    assert decoded.serial == "SIM1"


def test_without_white_image(draw_frame: Callable[..., Any], decoded: LightField) -> None:
    alone = decode(draw_frame(scene=texture, parallax=PARALLAX, noise=0.5).capture, None)
    assert alone.views.shape == decoded.views.shape
    inner = (slice(None), slice(None), slice(3, -3), slice(3, -3))
    views = [(7, 7), (7, 3), (10, 9)]
    for t, s in views:
        mine, reference = alone.views[t, s][inner[2:]], decoded.views[t, s][inner[2:]]
        scale = float((mine * reference).sum() / (mine**2).sum())
        assert scale == pytest.approx(1, abs=0.1)
        assert np.sqrt(np.mean((scale * mine - reference) ** 2)) < 0.03


def test_bright_places_are_not_clipped(draw_frame: Callable[..., Any], white: Capture) -> None:
    bright = draw_frame(scene=lambda x, y: np.full_like(x, 1.3), noise=0.0).capture
    dimmer = replace(white, mosaic=(64 + (white.mosaic.astype(float) - 64) * 0.7).astype(np.uint16))
    found = decode(bright, dimmer)
    # The scale is set by the white image's full light; 1.3 times its light at 700 of 959 DN.
    assert found.views[7, 7, 5:-5, 5:-5].mean() == pytest.approx(1.3 * 700 / 959, rel=0.03)
    twice = decode(bright, white, DecodeOptions(view=ViewOptions(views=3)))
    assert twice.views.shape[:2] == (3, 3)


@pytest.mark.parametrize(("pitch", "count"), [(14.3, 15), (14.2857, 15), (9.93, 9)])
def test_number_of_views_follows_the_micro_images(pitch: float, count: int) -> None:
    assert view_count(grid_of(pitch), ViewOptions()) == count


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (ViewOptions(views=4), "found 4, expected an odd number"),
        (ViewOptions(views=-3), "found -3, expected an odd number"),
        (ViewOptions(upsampling=5), "upsampling: found 5, expected 1 to 4"),
        (ViewOptions(upsampling=0), "upsampling: found 0, expected 1 to 4"),
        (ViewOptions(view_step_px=0.0), r"view_step_px: found 0, expected 0\.1 to 10"),
        (ViewOptions(view_step_px=float("nan")), "view_step_px: found nan"),
    ],
)
def test_impossible_views_are_refused(options: ViewOptions, match: str) -> None:
    with pytest.raises(ConfigError, match=match):
        view_count(grid_of(14.3), options)


def test_white_image_of_another_size_or_camera(draw_frame: Callable[..., Any], white: Capture) -> None:
    photo = draw_frame(shape=(380, 440), scene=texture).capture
    with pytest.raises(AssetError, match="found a white image of 440 x 400 px, expected 440 x 380"):
        decode(photo, white)
    other = replace(white, metadata=replace(white.metadata, serial="SIM2"))
    with pytest.raises(AssetError, match="found a white image of camera #6b06, expected #fb1c"):
        decode(draw_frame(scene=texture).capture, other)


def test_photograph_in_place_of_the_white_image(draw_frame: Callable[..., Any]) -> None:
    photo = draw_frame(scene=lambda x, y: 0.5 + 0.45 * np.sign(np.sin(x / 11) * np.sin(y / 13))).capture
    with pytest.raises(GridFitError, match="a white image stays below"):
        decode(photo, photo)


def grid_of(pitch: float, rotation: float = 0.0, shifted: int = 1, rows: int = 20, columns: int = 24) -> LensletGrid:
    cos, sin = np.cos(rotation), np.sin(rotation)
    down = pitch * np.sqrt(3) / 2
    return LensletGrid(
        origin_px=(20.3, 18.6),
        step_u_px=(pitch * cos, pitch * sin),
        step_v_px=(-down * sin, down * cos),
        first_shifted_row=shifted,
        rows=rows,
        columns=columns,
        sensor_shape=(300, 400),
        residual_px=0.0,
        quality=1.0,
        source="given",
    )


@pytest.mark.parametrize("shifted", [0, 1])
@pytest.mark.parametrize("rotation", [0.0, 0.01])
@pytest.mark.parametrize(
    ("upsampling", "interpolation"),
    [(1, "kriging"), (1, "barycentric"), (2, "kriging"), (3, "barycentric"), (3, "kriging")],
)
def test_sampling_tells_where_a_view_pixel_lies(
    shifted: int, rotation: float, upsampling: int, interpolation: Interpolation
) -> None:
    """Sample an image whose red is its own x and whose green is its own y: exact, as cubics keep straight lines."""
    grid = grid_of(14.3, rotation, shifted)
    y, x = np.mgrid[:300, :400].astype(np.float32)
    image = np.stack([x, y, np.ones_like(x)], axis=2)
    sampling = view_sampling(grid, 0.884, upsampling)
    read = LensletImage(image, grid.centres(), offsets_inside(grid, sampling, 3))
    lit = np.ones((300, 400), np.float32)
    views, weight = sample_views(read, lit, grid, sampling, 3, silent, upsampling, interpolation)
    assert views.shape[2:4] == (20 * upsampling, 28 * upsampling)
    light_field = LightField(views, weight, sampling, "", "test")
    true_x, true_y = view_positions(light_field)
    inner = (slice(2 * upsampling, -2 * upsampling), slice(3 * upsampling, -3 * upsampling))
    cos, sin = np.cos(rotation), np.sin(rotation)
    for t, s in ((1, 1), (0, 2), (2, 1)):
        dx, dy = 0.884 * (s - 1), 0.884 * (t - 1)
        found = views[t, s][inner]
        assert np.abs(found[..., 0] - true_x[inner] - cos * dx + sin * dy).max() < 0.002
        assert np.abs(found[..., 1] - true_y[inner] - sin * dx - cos * dy).max() < 0.002
        assert np.allclose(found[..., 2], 1, atol=1e-4)


def test_weight_is_zero_off_the_sensor() -> None:
    grid = replace(grid_of(14.3), origin_px=(-10.0, -5.0))
    sampling = view_sampling(grid, 0.884)
    read = LensletImage(np.ones((300, 400, 3), np.float32), grid.centres(), offsets_inside(grid, sampling, 1))
    _, weight = sample_views(read, np.ones((300, 400), np.float32), grid, sampling, 1)
    assert weight[0, 0, 0].max() < 30
    assert weight[0, 0, 5:15, 5:15].min() == 255


def test_view_columns_of_the_illum() -> None:
    assert view_columns(grid_of(14.3, rows=434, columns=541)) == 625


def test_upsampled_views_show_finer_steps_of_the_same_scene(draw_frame: Callable[..., Any], white: Capture) -> None:
    frame = draw_frame(scene=texture, parallax=PARALLAX, noise=0.0).capture
    errors = {}
    for interpolation in ("kriging", "barycentric"):
        options = DecodeOptions(view=ViewOptions(views=3, upsampling=2, interpolation=interpolation))  # type: ignore[arg-type]
        found = decode(frame, white, options)
        assert found.views.shape == (3, 3, 64, 72, 3)
        assert found.weight is not None and found.weight[1, 1, 6:-8, 6:-6].min() > 240
        x, y = view_positions(found)
        inner = (slice(6, -8), slice(6, -6))
        seen = found.views[1, 2, ..., 1][inner] * 959 / 700
        errors[interpolation] = np.sqrt(np.mean((seen - texture(x + PARALLAX * 0.884, y)[inner]) ** 2))
    assert errors["kriging"] < 0.008
    assert errors["barycentric"] < 0.03


def test_hexagon_weights_are_symmetric_and_sum_to_one() -> None:
    weights = hexagon_weights()
    assert weights.shape == (PHASES + 1, 13)
    assert np.allclose(weights.sum(1), 1, atol=1e-5)
    mirrored = np.concatenate([weights[::-1, 4::-1], weights[::-1, 8:4:-1], weights[::-1, 12:8:-1]], axis=1)
    assert np.allclose(weights, mirrored, atol=1e-4)


def test_like_the_toolbox_on_its_reference(real_data: Path, white: Capture) -> None:
    folder = real_data / "lftoolbox_reference" / "crop600"
    assert json.loads((folder / "grid_model.json").read_text())["UMax"] == 42
    meta = replace(white.metadata, width=600, height=600, white_balance=(1.0,) * 4)
    white_raw, photo = (
        Capture(unpack((folder / f"{name}.raw").read_bytes(), 600, 600, 10, "little", name), meta, name)
        for name in ("white", "lenslet")
    )
    ours = decode(photo, white_raw).views
    theirs = np.load(folder / "decoded.npz")["LF"][..., :3].astype(np.float32) / 65535
    assert ours.shape == theirs.shape == (15, 15, 48, 49, 3)
    for t, s in ((7, 7), (4, 7), (7, 11), (10, 10)):
        a, b = ours[t, s, 3:-3, 3:-3], theirs[t, s, 3:-3, 3:-3]
        scale = (a * b).sum((0, 1)) / (a * a).sum((0, 1))
        assert -10 * np.log10(np.mean((a * scale - b) ** 2)) > 38  # dB; it interpolates linearly, along rows only


def test_real_photograph_shows_parallax_of_the_right_sign(real_data: Path) -> None:
    import cv2

    capture = read_mosaic_image(real_data / "raw" / "tao_f01" / "IMG_1.jpg", "lytro-f01")
    found = decode(capture, None)
    assert found.views.shape == (9, 9, 382, 382, 3)
    grey = np.log(found.views[..., 1] + 0.02)

    def moved(area: tuple[slice, slice], t: int, s: int) -> tuple[float, float]:
        parts = [cv2.GaussianBlur(grey[n][area], (0, 0), 0.8).astype(np.float64) for n in ((4, 4), (t, s))]
        window = cv2.createHanningWindow(parts[0].shape[::-1], cv2.CV_64F)
        shift = cv2.phaseCorrelate(parts[0], parts[1], window)[0]
        return float(shift[0]), float(shift[1])

    trees, flower = (slice(60, 200), slice(260, 370)), (slice(140, 280), slice(100, 200))
    # Trees lie behind the plane in focus, so they move along with the view; the flower lies before it.
    assert moved(trees, 4, 6)[0] > 0.5
    assert moved(trees, 6, 4)[1] > 0.5
    assert moved(flower, 4, 6)[0] < -0.2
    assert moved(flower, 6, 4)[1] < -0.2
