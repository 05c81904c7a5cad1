"""The Virtual DSLR against closed forms: discs, occlusion, noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lfstereo.errors import ConfigError, InputError, ShapeError
from lfstereo.simulate.virtual_dslr import VirtualDslrOptions, blur_diameter_px, lens_points, virtual_dslr

CLEAN = VirtualDslrOptions(noise=False, lens_samples=64)
FOCI = np.linspace(100, 0, 5, dtype=np.float32)  # px
EXACT = 1e-5  # linear light


def flat(d: float, height: int = 41, width: int = 41) -> np.ndarray:
    return np.full((height, width), d, np.float32)


def noise_picture(height: int = 41, width: int = 41) -> np.ndarray:
    return np.random.default_rng(2).random((height, width, 3), dtype=np.float32)


def test_a_surface_in_focus_stays_as_it_is() -> None:
    picture = noise_picture()
    stack = virtual_dslr(picture, flat(75), FOCI, 0.4, CLEAN)
    np.testing.assert_allclose(stack.slices[1], picture, atol=EXACT)
    assert stack.aperture_ratio == 0.4
    np.testing.assert_array_equal(stack.disparities_px, FOCI)


def test_a_point_becomes_the_disc_of_the_circle_of_confusion() -> None:
    """Energy is kept; a disc of diameter c has the second moment c^2 / 8."""
    picture = np.zeros((41, 41, 3), np.float32)
    picture[20, 20] = 1.0
    slices = virtual_dslr(picture, flat(60), FOCI, 0.3, replace(CLEAN, lens_samples=400)).slices
    rows, columns = np.mgrid[-20:21, -20:21]
    for focus, slice_ in zip(FOCI, slices, strict=True):
        c = blur_diameter_px(60, float(focus), 0.3)
        disc = slice_[..., 1]
        assert disc.sum() == pytest.approx(1.0, rel=1e-4)
        moment = float((disc * (rows**2 + columns**2)).sum())
        assert moment == pytest.approx(c**2 / 8, abs=0.4)  # px^2: reading between pixels adds up to 1/3
        assert not disc[np.hypot(rows, columns) > c / 2 + 1.5].any()


def test_light_is_added_in_linear_light() -> None:
    picture = np.zeros((41, 41, 3), np.float32)
    picture[:, ::2] = 1.0
    blurred = virtual_dslr(picture, flat(100), np.float32([100, 0]), 0.2, replace(CLEAN, lens_samples=200)).slices[1]
    np.testing.assert_allclose(blurred[12:-12, 12:-12], 0.5, atol=0.06)


def test_colours_do_not_leak_from_a_sharp_foreground() -> None:
    """A red object in focus before a green wall: not a trace of red beyond its edge, none of green upon it."""
    disparity, picture = flat(10), np.zeros((41, 41, 3), np.float32)
    picture[..., 1] = 1.0
    disparity[:, 12:28] = 80
    picture[:, 12:28] = (1, 0, 0)
    slice_ = virtual_dslr(picture, disparity, np.float32([80]), 0.2, CLEAN).slices[0]
    np.testing.assert_allclose(slice_[:, 12:28], picture[:, 12:28], atol=EXACT)
    np.testing.assert_allclose(slice_[:, :12, 0], 0, atol=EXACT)
    np.testing.assert_allclose(slice_[:, 28:, 0], 0, atol=EXACT)


def test_a_blurred_foreground_covers_a_sharp_background_in_part() -> None:
    """Across the edge of a near half plane the share of red falls as the area of a disc cut by a line."""
    disparity, picture = flat(10, 41, 61), np.zeros((41, 61, 3), np.float32)
    picture[..., 1] = 1.0
    disparity[:, :30] = 60
    picture[:, :30] = (1, 0, 0)
    slice_ = virtual_dslr(picture, disparity, np.float32([10]), 0.4, replace(CLEAN, lens_samples=400)).slices[0]
    radius = blur_diameter_px(60, 10, 0.4) / 2
    t = np.clip((np.arange(61) - 29.5) / radius, -1, 1)
    covered = (np.arccos(t) - t * np.sqrt(1 - t**2)) / np.pi
    np.testing.assert_allclose(slice_[20, :, 0], covered, atol=0.06)
    np.testing.assert_allclose(slice_[..., :2].sum(-1), 1, atol=1e-4)  # the wall goes on behind the edge: no holes
    np.testing.assert_allclose(slice_[:, 50:], picture[:, 50:], atol=EXACT)


def test_only_differences_from_the_focus_matter() -> None:
    picture, disparity = noise_picture(), flat(3)
    disparity[10:30, 8:20] = 40
    a = virtual_dslr(picture, disparity, np.float32([25, 5]), 0.3, CLEAN).slices
    b = virtual_dslr(picture, disparity - 50, np.float32([-25, -45]), 0.3, CLEAN).slices
    np.testing.assert_allclose(a, b, atol=1e-4)


@pytest.mark.parametrize("count", [1, 3, 48, 300])
def test_lens_points_fill_the_disc(count: int) -> None:
    points = lens_points(count)
    assert points.shape == (count, 2)
    np.testing.assert_allclose(points.mean(0), 0, atol=1e-12)
    if count > 1:
        assert (points**2).sum(1).mean() == pytest.approx(0.5)
    if count >= 48:
        assert np.hypot(*points.T).max() < 1.05


def test_noise_has_the_variance_of_photons_and_reading() -> None:
    options = VirtualDslrOptions(peak_photons=400, read_noise=0.02, lens_samples=1, seed=3)
    for level in (0.0, 0.1, 0.8):
        picture = np.full((100, 100, 3), level, np.float32)
        slices = virtual_dslr(picture, flat(5, 100, 100), np.float32([5]), 0.1, options).slices
        assert slices.var() == pytest.approx(level / 400 + 0.02**2, rel=0.05)
        assert slices.mean() == pytest.approx(level, abs=0.001)


def test_noise_is_on_by_default_seeded_and_new_in_every_slice() -> None:
    picture = np.full((20, 20, 3), 0.5, np.float32)
    foci = np.float32([5, 4])
    a, b = (virtual_dslr(picture, flat(5, 20, 20), foci, 0.0).slices for _ in range(2))
    other = virtual_dslr(picture, flat(5, 20, 20), foci, 0.0, VirtualDslrOptions(seed=1)).slices
    np.testing.assert_array_equal(a, b)
    assert a.std() > 0.01
    assert abs(np.corrcoef(a[0].ravel(), a[1].ravel())[0, 1]) < 0.15
    assert abs(np.corrcoef(a[0].ravel(), other[0].ravel())[0, 1]) < 0.15


@pytest.mark.parametrize("count", [1, 16, 21])
def test_any_number_of_slices_with_progress(count: int) -> None:
    steps: list[tuple[int, int]] = []
    foci = np.linspace(90, 10, count, dtype=np.float32)
    stack = virtual_dslr(
        noise_picture(9, 8), flat(40, 9, 8), foci, 0.1, progress=lambda done, total: steps.append((done, total))
    )
    assert stack.slices.shape == (count, 9, 8, 3)
    assert steps == [(k + 1, count) for k in range(count)]


@pytest.mark.parametrize(
    ("ratio", "options", "message"),
    [
        (-0.1, CLEAN, "aperture_ratio = -0.1, expected 0 to 2"),
        (0.1, replace(CLEAN, lens_samples=0), "lens_samples = 0: expected 1 or more"),
        (0.1, replace(CLEAN, peak_photons=0.0), "peak_photons = 0.0"),
        (0.1, replace(CLEAN, read_noise=-1.0), "read_noise = -1.0"),
    ],
)
def test_impossible_options(ratio: float, options: VirtualDslrOptions, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        virtual_dslr(noise_picture(), flat(1), FOCI, ratio, options)


def test_arrays_that_do_not_fit() -> None:
    with pytest.raises(ShapeError, match="disparity: found an array of shape"):
        virtual_dslr(noise_picture(), flat(1, 40, 41), FOCI, 0.1, CLEAN)
    with pytest.raises(ShapeError, match="must fall"):
        virtual_dslr(noise_picture(), flat(1), FOCI[::-1], 0.1, CLEAN)
    unknown = flat(1)
    unknown[3, 4] = np.inf
    with pytest.raises(InputError, match="1 values of the disparity are not finite; fill unknown pixels first"):
        virtual_dslr(noise_picture(), unknown, FOCI, 0.1, CLEAN)
