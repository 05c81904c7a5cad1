"""The simulated sensor: colour that decodes to neutral, noise of known variance, levels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lfstereo.simulate.capture import take_picture, take_white_image
from lfstereo.simulate.frame_metadata import picture_metadata, white_metadata
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig
from lfstereo.simulate.scene import card, linear_rgb
from lfstereo.simulate.sensor import by_site, expose, hot_pixels, picture_filters, white_filters
from lfstereo.simulate.trace import vignetting

SIDES = ("left", "right")
SPAN_DN = 1023 - 64


def flat(level: float, size: int = 512) -> np.ndarray:
    return np.full((size, size), level, np.float32)


@pytest.mark.parametrize("side", SIDES)
def test_colour_of_the_metadata_undoes_the_sensor(rig: SimulatedRig, side: str) -> None:
    metadata = picture_metadata(rig.left, side)
    scene = np.array([0.4, 0.25, 0.1])
    raw = picture_filters(metadata) @ scene
    balanced = raw * by_site(metadata.white_balance, metadata.bayer)
    camera_rgb = np.array([balanced[0, 1], balanced[0, 0], balanced[1, 0]])
    assert balanced[0, 0] == pytest.approx(balanced[1, 1])
    decoded = np.reshape(metadata.ccm, (3, 3)) @ camera_rgb * 2**metadata.exposure_bias_ev
    np.testing.assert_allclose(decoded, scene, rtol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_grey_is_neutral_after_balance_alone(rig: SimulatedRig, side: str) -> None:
    metadata = picture_metadata(rig.left, side)
    balanced = picture_filters(metadata) @ np.full(3, 0.5) * by_site(metadata.white_balance, metadata.bayer)
    np.testing.assert_allclose(balanced, 0.5 * 2**-metadata.exposure_bias_ev, rtol=0.01)


def test_white_image_has_the_responses_of_its_metadata(rig: SimulatedRig, options: SimulateOptions) -> None:
    camera = replace(rig.left, sensor_px=(400, 400), principal_px=(199.0, 200.0))
    white = take_white_image(replace(rig, left=camera), "left", options)
    share = vignetting(camera)
    expected = by_site((0.776, 1.0, 1.0, 0.734), "grbg") * 0.8
    np.testing.assert_allclose(white_filters(white.metadata), expected, rtol=1e-12)
    for row in (0, 1):
        for column in (0, 1):
            signal = (white.mosaic[row::2, column::2].astype(float) - 64) / SPAN_DN
            bright = share[row::2, column::2] > 0.9
            ratio = np.median(signal[bright] / share[row::2, column::2][bright])
            assert ratio == pytest.approx(expected[row, column], rel=0.005)
    assert white.metadata.is_white_image
    assert white.metadata.white_balance == (1.0, 1.0, 1.0, 1.0)
    assert white.mosaic.max() <= 1023


def test_picture_divided_by_its_white_image_is_flat_grey(rig: SimulatedRig) -> None:
    options = SimulateOptions(sensor="small", noise=False, samples=1)
    small = replace(rig, left=replace(rig.left, sensor_px=(320, 300), principal_px=(160.0, 150.0)))
    picture = take_picture(card(0.9, 1.0), small, "left", options)
    white = take_white_image(small, "left", options)
    bright = vignetting(small.left) > 0.5
    signal = (picture.mosaic.astype(float) - 64) / (white.mosaic.astype(float) - 64).clip(1)
    for row in (0, 1):
        for column in (0, 1):
            response = by_site(white.metadata.normalized_responses, "grbg")[row, column] * 0.8
            gain = by_site(picture.metadata.white_balance, "grbg")[row, column]
            site = signal[row::2, column::2][bright[row::2, column::2]] * response * gain
            grey = linear_rgb("#808080")[0] * 2**-picture.metadata.exposure_bias_ev
            np.testing.assert_allclose(site, grey, rtol=0.02)


def test_exposure_scales_pictures_and_not_white_images(rig: SimulatedRig) -> None:
    small = replace(rig, left=replace(rig.left, sensor_px=(160, 150), principal_px=(80.0, 75.0)))
    plain, dark = (SimulateOptions(sensor="small", noise=False, samples=1, exposure=e) for e in (1.0, 0.25))
    full, quarter = (take_picture(card(0.9, 1.0), small, "left", o).mosaic.astype(float) - 64 for o in (plain, dark))
    assert full.max() > 100
    np.testing.assert_allclose(quarter, full / 4, atol=0.5 + 0.125)  # both rounded to whole DN
    whites = [take_white_image(small, "left", o).mosaic for o in (plain, dark)]
    np.testing.assert_array_equal(*whites)


@pytest.mark.parametrize("level", [0.02, 0.2, 0.8])
def test_noise_variance_follows_the_mean(rig: SimulatedRig, level: float) -> None:
    options = SimulateOptions(full_well_e=5000, read_noise_dn=1.5, hot_pixels=0)
    metadata = replace(picture_metadata(rig.left, "left"), width=512, height=512)
    mosaic = expose(flat(level), metadata, options, 1).astype(float)
    assert mosaic.mean() == pytest.approx(64 + level * SPAN_DN, abs=0.2)
    variance = level * SPAN_DN**2 / 5000 + 1.5**2 + 1 / 12
    assert mosaic.var() == pytest.approx(variance, rel=0.02)


def test_noise_is_white_and_belongs_to_frame_and_camera(rig: SimulatedRig) -> None:
    options = SimulateOptions(hot_pixels=0)
    left, right = (replace(picture_metadata(c, "left"), width=512, height=512) for c in (rig.left, rig.right))
    frames = [expose(flat(0.3), m, options, f).astype(float) for m, f in ((left, 1), (left, 2), (right, 1))]
    noise = [f - f.mean() for f in frames]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert abs(np.corrcoef(noise[a].ravel(), noise[b].ravel())[0, 1]) < 0.01
    for step in (1, 2, 512):
        assert abs(np.corrcoef(noise[0].ravel()[step:], noise[0].ravel()[:-step])[0, 1]) < 0.01
    assert np.array_equal(frames[0], expose(flat(0.3), left, options, 1))


def test_without_noise_only_rounding_is_left(rig: SimulatedRig) -> None:
    metadata = replace(picture_metadata(rig.left, "left"), width=512, height=512)
    assert np.all(expose(flat(0.5), metadata, SimulateOptions(noise=False), 1) == round(64 + 0.5 * SPAN_DN))
    assert np.all(expose(flat(7.0), metadata, SimulateOptions(noise=False), 1) == 1023)


def test_hot_pixels_belong_to_the_camera(rig: SimulatedRig) -> None:
    options = SimulateOptions(read_noise_dn=0.0)
    metadata = replace(picture_metadata(rig.left, "left"), width=512, height=512)
    places, extra = hot_pixels(metadata.serial, (512, 512), options.hot_pixels)
    assert places.shape == (300, 2)
    for frame in (1, 2):
        mosaic = expose(flat(0.0), metadata, options, frame)
        lit = np.argwhere(mosaic > 64 + 20)[:, ::-1]
        assert {tuple(p) for p in lit} <= {tuple(p) for p in places}
        assert len(lit) > 250
    assert extra.min() > 0.05


def test_metadata_tell_the_truth_but_for_the_lenslet_array(rig: SimulatedRig) -> None:
    picture, white = picture_metadata(rig.right, "right"), white_metadata(rig.right, "right")
    assert picture.serial == white.serial == rig.right.serial
    assert picture.lens == white.lens
    assert picture.lens.focal_length_m == rig.right.focal_length_m
    assert picture.lenslets != white.lenslets
    assert abs(picture.lenslets.rotation_rad - rig.right.lenslet_rotation_rad) < 5e-5
    np.testing.assert_allclose(np.reshape(picture.ccm, (3, 3)).sum(1), 1.0, atol=0.002)
