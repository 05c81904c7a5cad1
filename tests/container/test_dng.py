"""Raw mosaics as DNG, opened by LibRaw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy
import tifffile

from lfstereo.container import Capture, read_capture
from lfstereo.container.dng import colour_matrix, write_dng
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.errors import ContainerError, MetadataError, OutputError

SHAPE = (200, 240)


def capture_of(camera: str, **changes: Any) -> Capture:
    metadata = replace(read_camera_profile(camera), width=SHAPE[1], height=SHAPE[0], **changes)
    mosaic = np.random.default_rng(0).integers(0, int(min(metadata.white)) + 1, SHAPE, dtype=np.uint16)
    return Capture(mosaic, metadata, "drawn")


@pytest.mark.parametrize(
    ("camera", "pattern", "black", "white"),
    [("lytro-illum", "GRBG", 64, 1023), ("lytro-f01", "BGGR", 168, 4095)],
)
def test_libraw_finds_the_same_mosaic(tmp_path: Path, camera: str, pattern: str, black: int, white: int) -> None:
    capture = capture_of(camera, white_balance=(1.379, 1.0, 1.0, 1.148))
    write_dng(tmp_path / "a.dng", capture)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        np.testing.assert_array_equal(raw.raw_image, capture.mosaic)
        assert bytes(raw.color_desc[k] for k in raw.raw_pattern.ravel()).decode() == pattern
        assert raw.black_level_per_channel == [black] * 4
        assert raw.white_level == white
        gains = np.array(raw.camera_whitebalance[:3]) / raw.camera_whitebalance[1]
        assert gains == pytest.approx([1.379, 1.0, 1.148], rel=1e-3)


def test_black_levels_keep_their_sites(tmp_path: Path) -> None:
    capture = capture_of("lytro-illum", black=(60.0, 61.0, 62.0, 63.0))
    write_dng(tmp_path / "a.dng", capture)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        level = {tuple(np.argwhere(raw.raw_pattern == k)[0]): raw.black_level_per_channel[k] for k in range(4)}
    assert level == {(0, 0): 61, (0, 1): 60, (1, 0): 63, (1, 1): 62}


def test_colours_come_out_as_the_camera_s_matrix_makes_them(tmp_path: Path) -> None:
    """A flat patch, developed by LibRaw without its own tricks, against gains and matrix by hand."""
    ccm = np.array([[2.483, -1.102, -0.381], [-0.368, 1.667, -0.299], [-0.187, -0.733, 1.920]])
    gains = np.array([1.379, 1.0, 1.148])
    capture = capture_of("lytro-illum", white_balance=(1.379, 1.0, 1.0, 1.148), ccm=tuple(ccm.ravel()))
    rgb = np.array([0.3, 0.4, 0.25])
    flat = capture.mosaic.copy()
    for k, colour in enumerate(capture.metadata.bayer):
        flat[k // 2 :: 2, k % 2 :: 2] = 64 + 959 * rgb["rgb".index(colour)]
    write_dng(tmp_path / "a.dng", Capture(flat, capture.metadata, "flat"))
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        picture = raw.postprocess(
            use_camera_wb=True, no_auto_bright=True, gamma=(1, 1), output_bps=16, output_color=rawpy.ColorSpace.sRGB
        )
    found = picture[100, 120].astype(float)
    expected = ccm / ccm.sum(1, keepdims=True) @ (gains * rgb)
    assert found / found[1] == pytest.approx(expected / expected[1], abs=0.02)


def test_white_is_the_neutral_colour() -> None:
    metadata = capture_of("lytro-illum", ccm=(1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0), white_balance=(2.0, 1.0, 1.0, 4.0))
    d65 = np.array([0.95047, 1.0, 1.08883])
    assert colour_matrix(metadata.metadata, "x") @ d65 == pytest.approx([0.5, 1.0, 0.25], abs=1e-4)


@pytest.mark.parametrize("camera", ["lytro-illum", "lytro-f01"])
def test_round_trip(tmp_path: Path, camera: str) -> None:
    capture = capture_of(camera, serial="B1", white_balance=(1.379, 1.0, 1.0, 1.148), is_white_image=True)
    write_dng(tmp_path / "a.dng", capture)
    found = read_capture(tmp_path / "a.dng")
    np.testing.assert_array_equal(found.mosaic, capture.mosaic)
    assert found.metadata == replace(capture.metadata, firmware=found.metadata.firmware)
    assert found.source == str(tmp_path / "a.dng")


def test_forward_matrix_makes_white_white(tmp_path: Path) -> None:
    write_dng(tmp_path / "a.dng", capture_of("lytro-illum"))
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        numbers = np.array(file.pages.first.tags[50964].value, float)
    matrix = (numbers[::2] / numbers[1::2]).reshape(3, 3)
    assert matrix.sum(1) == pytest.approx([0.9642, 1.0, 0.8252], abs=5e-4)  # D50


def test_dng_that_holds_no_light_field(tmp_path: Path) -> None:
    (tmp_path / "text.dng").write_text("no picture")
    with pytest.raises(ContainerError, match="not a readable DNG"):
        read_capture(tmp_path / "text.dng")
    tifffile.imwrite(tmp_path / "other.dng", np.zeros((4, 4), np.uint16))
    with pytest.raises(ContainerError, match="found a DNG without a light-field camera's metadata"):
        read_capture(tmp_path / "other.dng")
    for content, match in ((b"[]", "private data"), (b'{"public": 1}', "found private data without metadata")):
        private = b"lfstereo\0" + content
        tifffile.imwrite(
            tmp_path / "odd.dng", np.zeros((4, 4), np.uint16), extratags=[(50740, 1, len(private), private, True)]
        )
        with pytest.raises(ContainerError, match=match):
            read_capture(tmp_path / "odd.dng")
    capture = capture_of("lytro-illum")
    write_dng(tmp_path / "small.dng", replace(capture, mosaic=capture.mosaic[:100]))
    with pytest.raises(ContainerError, match=r"with shape \(100, 240\), expected uint16 of 200 x 240"):
        read_capture(tmp_path / "small.dng")
    write_dng(tmp_path / "cut.dng", capture)
    (tmp_path / "cut.dng").write_bytes((tmp_path / "cut.dng").read_bytes()[:5000])
    with pytest.raises(ContainerError, match=r"cut\.dng"):
        read_capture(tmp_path / "cut.dng")


def test_refusals(tmp_path: Path) -> None:
    capture = capture_of("lytro-illum")
    write_dng(tmp_path / "a.dng", capture)
    with pytest.raises(OutputError, match="exists already"):
        write_dng(tmp_path / "a.dng", capture)
    for changes in ({"ccm": (1.0,) * 9}, {"white_balance": (0.0, 1.0, 1.0, 1.0)}):
        with pytest.raises(MetadataError, match="expected a matrix with an inverse and positive gains"):
            write_dng(tmp_path / "b.dng", capture_of("lytro-illum", **changes))
    assert not (tmp_path / "b.dng").exists()
