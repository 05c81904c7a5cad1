"""Development of a mosaic: what must stay grey, linear, flat or untouched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lfstereo.container import Capture
from lfstereo.develop.colour import grey_world_gains, white_balance
from lfstereo.develop.demosaic import DEMOSAIC, malvar2004
from lfstereo.develop.develop import develop, normalise_levels
from lfstereo.develop.highlights import lift_clipped
from lfstereo.develop.hotpixels import repair_hot_pixels
from lfstereo.develop.options import DevelopOptions
from lfstereo.develop.shading import devignette, shading_from_photograph, shading_from_white_image
from lfstereo.errors import AssetError
from lfstereo.lenslet.fit import estimate_grid_from_photograph
from lfstereo.lenslet.flatten import mean_brightness, site_levels

SHAPE = (60, 80)
BAYERS = ["grbg", "rggb", "bggr", "gbrg"]
ILLUM_CCM = (2.227, -1.055, -0.172, -0.427, 1.746, -0.319, -0.205, -0.747, 1.952)


def mosaic_of(rgb: np.ndarray, bayer: str) -> np.ndarray:
    out = np.empty(rgb.shape[:2], np.float32)
    for k, name in enumerate(bayer):
        out[k // 2 :: 2, k % 2 :: 2] = rgb[k // 2 :: 2, k % 2 :: 2, "rgb".index(name)]
    return out


@pytest.fixture(scope="module")
def capture(draw_frame: Callable[..., Any]) -> Capture:
    found: Capture = draw_frame(shape=(240, 260), noise=0.0).capture
    return found


def with_values(capture: Capture, linear: np.ndarray, **changes: Any) -> Capture:
    """Return the capture with a mosaic of given linear values, 1 = white level."""
    numbers = np.clip(np.round(64 + linear * (1023 - 64)), 0, 1023).astype(np.uint16)
    height, width = numbers.shape
    return replace(capture, mosaic=numbers, metadata=replace(capture.metadata, height=height, width=width, **changes))


@pytest.mark.parametrize("method", sorted(DEMOSAIC))
@pytest.mark.parametrize("bayer", BAYERS)
def test_demosaic_keeps_constants_and_ramps(method: str, bayer: str) -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(np.float32)
    ramps = np.stack([0.1 + 0.004 * x, 0.2 + 0.003 * y, 0.3 + 0.002 * x - 0.001 * y], axis=2)
    found = DEMOSAIC[method](mosaic_of(ramps, bayer), bayer)  # type: ignore[index]
    # OpenCV rounds to 16 bits on the way: 2e-5 of the brightest.
    assert np.abs(found - ramps)[4:-4, 4:-4].max() < (2e-5 if method == "opencv-edge-aware" else 1e-5)


def test_malvar_beats_bilinear_on_a_grey_wave() -> None:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    wave = np.repeat((0.5 + 0.3 * np.sin(x / 1.9 + y / 2.7))[..., None], 3, axis=2).astype(np.float32)
    errors = {
        name: float(np.abs(method(mosaic_of(wave, "grbg"), "grbg") - wave)[4:-4, 4:-4].mean())
        for name, method in DEMOSAIC.items()
    }
    assert errors["malvar2004"] < 0.6 * errors["bilinear"]


def test_malvar_at_one_bright_green_site() -> None:
    # Figure 2 of the paper: at green in a red row, red takes 5/8 of the green value.
    mosaic = np.zeros((12, 12), np.float32)
    mosaic[4, 4] = 0.8
    assert malvar2004(mosaic, "grbg")[4, 4].tolist() == pytest.approx([0.5, 0.8, 0.5])


@pytest.mark.parametrize("bayer", BAYERS)
def test_grey_stays_grey(capture: Capture, bayer: str) -> None:
    gains = (1.379, 1.0, 1.0, 1.148)
    grey = np.full((*SHAPE, 3), 0.3) / (gains[0], 1.0, gains[3])
    photo = with_values(capture, mosaic_of(grey, bayer), bayer=bayer, ccm=ILLUM_CCM, white_balance=gains)
    found = develop(photo, np.ones(SHAPE, np.float32))
    assert np.abs(found[4:-4, 4:-4] - 0.3).max() < 0.003  # a digital number is 0.001, the matrix doubles it


def test_development_is_linear(capture: Capture) -> None:
    rng = np.random.default_rng(3)
    texture = np.round(rng.uniform(50, 400, SHAPE)) / (1023 - 64)
    options = DevelopOptions(hot_pixels=False)
    shading = rng.uniform(0.2, 1.0, SHAPE).astype(np.float32)
    once = develop(with_values(capture, texture, ccm=ILLUM_CCM), shading, options)
    twice = develop(with_values(capture, 2 * texture, ccm=ILLUM_CCM), shading, options)
    assert np.allclose(twice, 2 * once, atol=1e-4)
    assert twice.max() > 1


def test_exposure_bias_is_applied_and_can_be_left_out(capture: Capture) -> None:
    photo = with_values(capture, np.full(SHAPE, 0.2), exposure_bias_ev=1.0, white_balance=(1.0,) * 4)
    flat = np.ones(SHAPE, np.float32)
    assert develop(photo, flat)[20, 20].tolist() == pytest.approx([0.4] * 3, abs=0.002)
    without = develop(photo, flat, DevelopOptions(exposure_bias=False))
    assert without[20, 20].tolist() == pytest.approx([0.2] * 3, abs=0.001)


def test_white_balance_and_grey_world_undo_a_cast() -> None:
    rng = np.random.default_rng(0)
    grey = rng.uniform(0.1, 0.6, SHAPE)[..., None] * np.array([0.5, 1.0, 0.7])
    mosaic = mosaic_of(grey, "grbg")
    gains = grey_world_gains(mosaic, "grbg")
    assert gains == pytest.approx((2.0, 1.0, 1.0, 1 / 0.7), rel=0.05)
    white_balance(mosaic, (2.0, 1.0, 1.0, 1 / 0.7), "grbg")
    assert np.allclose(mosaic, mosaic_of(grey / [0.5, 1.0, 0.7], "grbg"), atol=1e-6)


def test_grey_world_can_be_chosen(capture: Capture) -> None:
    cast = np.full((*SHAPE, 3), 0.3) * [0.5, 1.0, 0.7]
    photo = with_values(capture, mosaic_of(cast, "grbg"))
    found = develop(photo, np.ones(SHAPE, np.float32), DevelopOptions(white_balance="grey-world"))
    assert np.abs(found[4:-4, 4:-4] - 0.3).max() < 0.003


def test_devignetting_undoes_the_white_image_without_its_colour(draw_frame: Callable[..., Any]) -> None:
    white = draw_frame(noise=0.0).capture
    shading = shading_from_white_image(white)
    assert np.percentile(shading, 99) == pytest.approx(1.0, abs=0.05)
    half = draw_frame(noise=0.0, scene=lambda x, y: np.full_like(x, 0.5)).capture
    flat = devignette(normalise_levels(half), shading, 0.05)
    lit = shading > 0.3
    sites = np.array([[1.0, 0.776], [0.734, 1.0]])
    expected = 0.5 * 700 / (1023 - 64) * np.tile(sites, (200, 220))
    assert np.abs(flat / expected - 1)[lit].max() < 0.05
    # Where hardly any light falls the floor keeps noise from being blown up.
    assert flat[shading < 0.02].max() < flat[lit].mean()


def test_devignetting_clips_nothing(capture: Capture) -> None:
    mosaic = np.full(SHAPE, 0.9, np.float32)
    assert devignette(mosaic, np.full(SHAPE, 0.3, np.float32), 0.05).max() == pytest.approx(3.0)


def test_devignetting_refuses_another_size() -> None:
    with pytest.raises(AssetError, match="found 10 x 8 px, expected 12 x 8"):
        devignette(np.ones((8, 12), np.float32), np.ones((8, 10), np.float32), 0.05)


def test_illumination_from_the_photograph_itself(draw_frame: Callable[..., Any]) -> None:
    def scene(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 0.5 + 0.3 * np.sin(x / 17) * np.sin(y / 13)

    photo = draw_frame(scene=scene, parallax=2.0).capture
    true = shading_from_white_image(draw_frame(noise=0.0).capture)
    found = shading_from_photograph(photo, estimate_grid_from_photograph(photo))
    inner = (slice(20, -20), slice(20, -20))
    assert np.abs(found - true)[inner].mean() < 0.03


def noisy_edge() -> np.ndarray:
    rng = np.random.default_rng(1)
    edge = np.where(np.arange(80) < 40, 0.2, 0.7)[None].repeat(60, 0).astype(np.float32)
    return (edge * rng.uniform(0.97, 1.03, SHAPE)).astype(np.float32)


def test_hot_and_dead_pixels_are_replaced_and_edges_are_not() -> None:
    frame, lit = noisy_edge(), np.ones(SHAPE, np.float32)
    clean = frame.copy()
    assert repair_hot_pixels(frame, lit, excess=0.5, noise=0.05) == 0
    frame[20, 20], frame[31, 61] = 0.9, 0.05
    assert repair_hot_pixels(frame, lit, excess=0.5, noise=0.05) == 2
    assert np.abs(frame - clean).max() < 0.05


def test_known_pixels_are_replaced_from_good_neighbours_only() -> None:
    frame, lit = noisy_edge(), np.ones(SHAPE, np.float32)
    clean = frame.copy()
    known = np.array([[20, 20], [22, 20], [61, 31], [79, 59], [80, 3], [5, 60]], np.uint16)  # the last two lie outside
    frame[known[:4, 1], known[:4, 0]] *= 1.2  # too little to be found without the list
    assert repair_hot_pixels(frame.copy(), lit, excess=0.5, noise=0.05) == 0
    assert repair_hot_pixels(frame, lit, excess=0.5, noise=0.05, known=known) == 4
    assert np.abs(frame - clean).max() < 0.045  # twice the noise of the brighter side


def test_noise_in_the_dark_and_details_of_the_scene_are_no_hot_pixels() -> None:
    rng = np.random.default_rng(4)
    dark = np.full(SHAPE, 0.02, np.float32)
    noise = np.maximum(0.5 + rng.normal(0, 0.01, SHAPE) / dark, 0).astype(np.float32)  # noise 0.01 before the division
    assert repair_hot_pixels(noise, dark, excess=0.5, noise=0.05) == 0
    assert repair_hot_pixels(noise, np.ones(SHAPE, np.float32), excess=0.5, noise=0.05) > 20
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    star = (0.1 + 0.8 * np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 1.3)).astype(np.float32)
    assert repair_hot_pixels(star, np.ones(SHAPE, np.float32), excess=0.5, noise=0.05) == 0


def test_list_of_hot_pixels_reaches_the_development(capture: Capture) -> None:
    values = np.full(SHAPE, 0.4)
    values[20, 31] = 0.5
    photo, lit = with_values(capture, values, white_balance=(1.0,) * 4), np.ones(SHAPE, np.float32)
    assert develop(photo, lit).max() > 0.45
    assert develop(photo, lit, hot_pixels=np.array([[31, 20]], np.uint16)).max() < 0.41


def test_clipped_highlights_become_neutral(capture: Capture) -> None:
    # White paper twice too bright: green and then all colours clip at 1; white balance would leave it pink.
    gains = (1.379, 1.0, 1.0, 1.148)
    for level, spread in ((2.0, 0.01), (1.2, 0.25)):
        paper = np.minimum(np.full((*SHAPE, 3), level) / (gains[0], 1.0, gains[3]), 1.0)
        photo = with_values(capture, mosaic_of(paper, "grbg"), white_balance=gains)
        found = develop(photo, np.ones(SHAPE, np.float32))[10:-10, 10:-10]
        assert np.ptp(found.mean((0, 1))) < spread
        assert found.mean() > 1.0


@pytest.mark.parametrize("bayer", BAYERS)
def test_saturated_grey_ramp_stays_neutral(capture: Capture, bayer: str) -> None:
    """From black to six times the level that clips, evenly lit and behind the rim of a micro-image."""
    gains = (1.379, 1.0, 1.0, 1.148)
    ramp = np.repeat((np.linspace(0.0, 6.0, 600)[None, :, None]), 3, axis=2).repeat(40, 0)
    for light in (1.0, 0.4):
        numbers = np.minimum(light * ramp / (gains[0], 1.0, gains[3]), 1.0)
        photo = with_values(capture, mosaic_of(numbers, bayer), bayer=bayer, ccm=ILLUM_CCM, white_balance=gains)
        found = develop(photo, np.full((40, 600), light, np.float32))[8:-8, 8:-8]
        assert np.ptp(found, axis=2).max() < 0.05 * found.max()
        brightness = found.mean((0, 2))
        assert (np.diff(brightness) > -0.02).all()  # brighter light never comes out darker
        assert brightness[-1] == pytest.approx(gains[0] / light, rel=0.02)  # the last colour to clip sets the level


def test_coloured_lamp_keeps_its_colour(capture: Capture) -> None:
    """Red and green clip, blue is far below: nothing says that the light is white."""
    lamp = np.full((*SHAPE, 3), 1.0) * [1.3, 1.02, 0.1]
    photo = with_values(capture, mosaic_of(np.minimum(lamp, 1.0), "grbg"), white_balance=(1.3, 1.0, 1.0, 1.0))
    found = develop(photo, np.ones(SHAPE, np.float32))[10:-10, 10:-10].mean((0, 1))
    assert found == pytest.approx([1.3, 1.0, 0.1], abs=0.01)


def test_unclipped_values_are_not_lifted(capture: Capture) -> None:
    rng = np.random.default_rng(2)
    photo = with_values(capture, rng.uniform(0, 0.9, SHAPE))
    mosaic = normalise_levels(photo)
    before = mosaic.copy()
    lift_clipped(mosaic, photo.mosaic, photo.metadata, (1.4, 1.0, 1.0, 1.2))
    assert np.array_equal(mosaic, before)


def test_stuck_pixels_in_the_dark_stay_dark(capture: Capture) -> None:
    """A site that reads white alone and was filled in from its neighbours, who saw nothing."""
    values = np.zeros(SHAPE)
    values[20, 30] = 1.0
    photo = with_values(capture, values)
    mosaic = np.zeros(SHAPE, np.float32)
    lift_clipped(mosaic, photo.mosaic, photo.metadata, (1.4, 1.0, 1.0, 1.2))
    assert not mosaic.any()


def test_levels(capture: Capture) -> None:
    photo = with_values(capture, np.array([[0.0, 1.0], [0.5, 0.25]]).repeat(3, 0).repeat(3, 1))
    assert normalise_levels(photo).min() == 0
    assert normalise_levels(photo).max() == 1
    assert mean_brightness(photo) == pytest.approx(0.4375, abs=1e-3)
    assert site_levels((1.0, 2.0, 3.0, 4.0), "bggr") == ((4.0, 3.0), (2.0, 1.0))
