"""Mosaics stored as ordinary images, and camera profiles."""

from __future__ import annotations

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

from lfstereo.container.mosaic_image import camera_names, read_camera_profile, read_mosaic_image
from lfstereo.errors import AssetError, ConfigError, ContainerError, MetadataError


@pytest.fixture
def small_camera(tmp_path: Path) -> str:
    """A profile like the F01's, for a sensor of 50 x 40 pixels."""
    from lfstereo.assets import asset_folder

    text = (asset_folder("calib") / "cameras" / "lytro-f01.toml").read_text()
    path = tmp_path / "small.toml"
    path.write_text(text.replace("width = 3280", "width = 50").replace("height = 3280", "height = 40"))
    return str(path)


def test_profiles_of_both_cameras() -> None:
    assert camera_names() == ("lytro-f01", "lytro-illum")
    f01, illum = read_camera_profile("lytro-f01"), read_camera_profile("lytro-illum")
    assert (f01.model, f01.width, f01.height, f01.bits_per_pixel, f01.bayer) == ("F01", 3280, 3280, 12, "bggr")
    assert (illum.model, illum.width, illum.height, illum.bits_per_pixel, illum.bayer) == (
        "ILLUM",
        7728,
        5368,
        10,
        "grbg",
    )
    assert (f01.black[0], f01.white[0], illum.black[0], illum.white[0]) == (168.0, 4095.0, 64.0, 1023.0)
    # A white of the sensor stays a white after the colour matrix: its rows sum to 1.
    for profile in (f01, illum):
        assert np.reshape(profile.ccm, (3, 3)).sum(axis=1) == pytest.approx([1.0, 1.0, 1.0], abs=1e-4)
    assert [cct for cct, _ in illum.ccm_by_cct] == [2850.0, 4150.0, 6500.0]


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_mosaic_is_read_as_it_is(tmp_path: Path, small_camera: str, suffix: str, dtype: type) -> None:
    top = 255 if dtype == np.uint8 else 4095
    pixels = np.random.default_rng(2).integers(0, top + 1, (40, 50)).astype(dtype)
    iio.imwrite(tmp_path / f"a{suffix}", pixels)
    found = read_mosaic_image(tmp_path / f"a{suffix}", small_camera)
    assert np.array_equal(found.mosaic, pixels)
    assert found.mosaic.dtype == np.uint16
    levels = (10.46, 255.0, 8) if dtype == np.uint8 else (168.0, 4095.0, 16)
    assert (found.metadata.black[0], found.metadata.white[0], found.metadata.bits_per_pixel) == levels


def test_grey_stored_as_three_equal_channels(tmp_path: Path, small_camera: str) -> None:
    pixels = np.random.default_rng(2).integers(0, 256, (40, 50)).astype(np.uint8)
    iio.imwrite(tmp_path / "a.png", np.repeat(pixels[..., None], 3, axis=2))
    assert np.array_equal(read_mosaic_image(tmp_path / "a.png", small_camera).mosaic, pixels)


def test_unknown_camera() -> None:
    with pytest.raises(
        AssetError, match="raytrix: found no such camera profile, expected one of lytro-f01, lytro-illum"
    ):
        read_camera_profile("raytrix")


def test_damaged_profiles(tmp_path: Path, small_camera: str) -> None:
    text = Path(small_camera).read_text()
    (tmp_path / "a.toml").write_text("= 5")
    with pytest.raises(ConfigError, match="not valid TOML"):
        read_camera_profile(str(tmp_path / "a.toml"))
    (tmp_path / "a.toml").write_text(text.replace("lensPitch", "pitch"))
    with pytest.raises(MetadataError, match=r"a\.toml: field 'devices\.mla\.lensPitch' is missing"):
        read_camera_profile(str(tmp_path / "a.toml"))
    (tmp_path / "a.toml").write_text(text.replace("black = 10.46", ""))
    with pytest.raises(MetadataError, match=r"a\.toml: levels_8_bit: field 'image\.pixelFormat\.black\.r': found None"):
        read_camera_profile(str(tmp_path / "a.toml"), bits=8)


def test_files_that_are_no_mosaic(tmp_path: Path, small_camera: str) -> None:
    image = tmp_path / "a.png"
    with pytest.raises(ContainerError, match=r"a\.png: cannot be read \(No such file"):
        read_mosaic_image(image, small_camera)
    with pytest.raises(ContainerError, match=r"found the suffix '\.mp4', expected one of \.jpg"):
        read_mosaic_image(tmp_path / "a.mp4", small_camera)
    image.write_bytes(b"no image")
    with pytest.raises(ContainerError, match="cannot be read as an image"):
        read_mosaic_image(image, small_camera)
    iio.imwrite(image, np.random.default_rng(0).integers(0, 256, (40, 50, 3)).astype(np.uint8))
    with pytest.raises(ContainerError, match=r"found an image of uint8 with shape \(40, 50, 3\), expected one channel"):
        read_mosaic_image(image, small_camera)
    iio.imwrite(image, np.zeros((40, 48), np.uint8))
    with pytest.raises(ContainerError, match="found an image of 48 x 40 pixels, expected 50 x 40 of camera"):
        read_mosaic_image(image, small_camera)
    iio.imwrite(image, np.full((40, 50), 4096, np.uint16))
    with pytest.raises(ContainerError, match="found values up to 4096, expected at most the white level 4095"):
        read_mosaic_image(image, small_camera)


def test_image_cut_off(tmp_path: Path, small_camera: str) -> None:
    iio.imwrite(tmp_path / "a.jpg", np.random.default_rng(0).integers(0, 256, (40, 50)).astype(np.uint8))
    data = (tmp_path / "a.jpg").read_bytes()
    for length in (0, 10, len(data) // 2, len(data) - 30):
        (tmp_path / "a.jpg").write_bytes(data[:length])
        with pytest.raises(ContainerError, match="cannot be read as an image"):
            read_mosaic_image(tmp_path / "a.jpg", small_camera)


def test_real_photograph(real_data: Path) -> None:
    found = read_mosaic_image(real_data / "raw" / "tao_f01" / "IMG_1.jpg", "lytro-f01")
    assert found.mosaic.shape == (3280, 3280)
    assert (found.metadata.black[0], found.metadata.bits_per_pixel) == (pytest.approx(16 * 10.46), 16)
    assert 9 <= np.percentile(found.mosaic, 1) / 16 <= 20  # the black level, as stored


def test_a_jpeg_gets_its_pattern_back_and_a_png_stays_as_it_is(tmp_path: Path) -> None:
    flat = np.full((3280, 3280), 60, np.uint8)
    for suffix, levels in ((".jpg", 16), (".png", 1)):
        iio.imwrite(tmp_path / f"flat{suffix}", flat)
        capture = read_mosaic_image(tmp_path / f"flat{suffix}", "lytro-f01")
        assert capture.metadata.white_balance == (1.01, 1.0, 1.0, 1.48)
        assert capture.metadata.white == (255.0 * levels,) * 4
        blue, green = (float(capture.mosaic[0, k]) / levels - 10.46 for k in (0, 1))
        assert blue / green == pytest.approx(1 / 1.48 if suffix == ".jpg" else 1.0, abs=0.1)
