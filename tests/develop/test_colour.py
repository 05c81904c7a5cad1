"""Colour matrices by temperature, and colour spaces against colour-science."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.container import Capture, FrameMetadata, read_container
from lfstereo.container.capture import read_metadata
from lfstereo.container.mosaic_image import read_camera_profile
from lfstereo.develop.colour import camera_matrix
from lfstereo.develop.colour_spaces import NAMES, conversion, decode_table, encode, to_d50
from lfstereo.develop.develop import develop
from lfstereo.develop.options import ColourSpace, DevelopOptions, Primaries
from lfstereo.errors import ConfigError, MetadataError

SPACES: list[ColourSpace] = ["srgb", "linear", "display-p3", "prophoto"]


@pytest.fixture(scope="module")
def science() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip("colour")


@pytest.fixture
def illum() -> FrameMetadata:
    return read_camera_profile("lytro-illum")


def test_matrix_is_interpolated_linearly_in_kelvin(illum: FrameMetadata) -> None:
    (_, warm), (_, middle), (_, cold) = illum.ccm_by_cct
    assert camera_matrix(illum, 4150).ravel() == pytest.approx(middle, abs=1e-4)
    half = (np.array(middle) + cold) / 2
    assert camera_matrix(illum, (4150 + 6500) / 2).ravel() == pytest.approx(half, abs=1e-4)
    assert camera_matrix(illum, 2000).ravel() == pytest.approx(warm, abs=1e-4)
    assert camera_matrix(illum, 9000).ravel() == pytest.approx(cold, abs=1e-4)
    assert camera_matrix(illum, 3333).sum(1) == pytest.approx([1.0] * 3)
    assert camera_matrix(illum).ravel() == pytest.approx(illum.ccm, abs=1e-4)


@pytest.mark.parametrize("name", ["illum_processed.LFP", "illum_stack.lfp"])
def test_real_cameras_interpolate_in_this_way(real_data: Path, name: str) -> None:
    """The matrix that the camera wrote for 3505 K and for 5500 K; temperatures are rounded to a kelvin."""
    found = read_metadata(read_container(real_data / "containers" / name))
    assert found.awb_cct_k in (3505, 5500)
    assert camera_matrix(found, found.awb_cct_k).ravel() == pytest.approx(found.ccm, abs=1.5e-3)


def test_matrices_that_cannot_be(illum: FrameMetadata) -> None:
    with pytest.raises(MetadataError, match=r"ccm: found rows with sums \[0\.0, 1\.0, 1\.0\], expected about 1"):
        camera_matrix(replace(illum, ccm=(1.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)))
    with pytest.raises(MetadataError, match="perCcm: found no colour matrices to interpolate at 5000 K"):
        camera_matrix(replace(illum, ccm_by_cct=()), 5000)
    with pytest.raises(ConfigError, match="temperature_k: found 65, expected 1000 to 40000 K"):
        camera_matrix(illum, 65)


def test_wide_colour_space_keeps_colours_outside_srgb(illum: FrameMetadata) -> None:
    """Saturated green, developed to both, is the same light; sRGB needs a negative red for it."""
    shape = (40, 48)
    numbers = np.full(shape, 64, np.uint16)
    for k, colour in enumerate(illum.bayer):
        numbers[k // 2 :: 2, k % 2 :: 2] += {"r": 110, "g": 500, "b": 190}[colour]
    photo = Capture(numbers, replace(illum, width=shape[1], height=shape[0]), "green")
    lit = np.ones(shape, np.float32)
    narrow = develop(photo, lit)[20, 20]
    wide = develop(photo, lit, DevelopOptions(colour_space="prophoto"))[20, 20]
    assert narrow[0] < 0 < wide.min()
    assert conversion("prophoto", "srgb") @ wide == pytest.approx(narrow, abs=1e-4)
    with pytest.raises(ConfigError, match="colour_space: found prophoto without the colour matrix"):
        develop(photo, lit, DevelopOptions(colour_space="prophoto", colour_matrix=False))


@pytest.mark.parametrize("primaries", ["display-p3", "prophoto"])
def test_conversions_are_those_of_colour_science(science: Any, primaries: Primaries) -> None:
    spaces = science.RGB_COLOURSPACES
    expected = science.matrix_RGB_to_RGB(spaces[NAMES[primaries]], spaces["sRGB"], "Bradford")
    # Published matrices and whites have four decimals.
    assert np.abs(conversion(primaries, "srgb") - expected).max() < 1e-3
    assert conversion(primaries, "srgb") @ conversion("srgb", primaries) == pytest.approx(np.eye(3), abs=1e-12)
    assert to_d50(primaries).sum(1) == pytest.approx([0.9642, 1.0, 0.8249], abs=1e-12)


@pytest.mark.parametrize("space", SPACES)
def test_curves_are_those_of_colour_science(science: Any, space: ColourSpace) -> None:
    light = np.linspace(0, 1, 4001).astype(np.float32)
    coded = encode(light, space)
    if space != "linear":
        expected = science.RGB_COLOURSPACES[NAMES[space]].cctf_encoding(light)
        assert np.abs(coded - expected).max() < 1e-6
    table = decode_table(65535, space)
    assert np.abs(table[np.rint(coded * 65535).astype(int)] - light).max() < 3e-5
    assert encode(np.array([-1.0, 7.0], np.float32), space).tolist() == [0.0, 1.0]
