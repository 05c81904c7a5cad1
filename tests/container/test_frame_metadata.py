"""Metadata in every layout that the cameras write, and each way they can be unusable."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lfstereo.container import FrameMetadata
from lfstereo.container.layouts import private_metadata, public_metadata, sidecar_metadata
from lfstereo.container.metadata import EXIT_PUPIL_AT_INFINITY_M, parse_metadata
from lfstereo.errors import MetadataError


def without(tree: dict[str, Any], path: str) -> dict[str, Any]:
    """Return a copy without one field."""
    result = copy.deepcopy(tree)
    *keys, last = path.split(".")
    inner = result
    for key in keys:
        inner = inner[key]
    del inner[last]
    return result


def changed(tree: dict[str, Any], path: str, value: object) -> dict[str, Any]:
    """Return a copy with one field set."""
    result = copy.deepcopy(tree)
    *keys, last = path.split(".")
    inner = result
    for key in keys:
        inner = inner[key]
    inner[last] = value
    return result


def test_illum_picture_round_trip(illum: FrameMetadata) -> None:
    text = json.dumps(public_metadata(illum)), json.dumps(private_metadata(illum))
    assert parse_metadata(json.loads(text[0]), json.loads(text[1]), "x") == illum


def test_illum_picture_round_trip_of_what_may_be_unknown(illum: FrameMetadata) -> None:
    bare = replace(illum, awb_cct_k=None, exposure_s=None, ccm_by_cct=(), serial="")
    assert parse_metadata(public_metadata(bare), private_metadata(bare), "x") == bare


def test_f01_picture_round_trip(f01: FrameMetadata) -> None:
    assert parse_metadata(public_metadata(f01), private_metadata(f01), "x") == f01


@pytest.mark.parametrize("white", [True, False])
def test_text_file_round_trip(illum: FrameMetadata, f01: FrameMetadata, white: bool) -> None:
    for metadata in (illum, f01):
        tagged = replace(metadata, is_white_image=white, is_dark_frame=not white)
        written = sidecar_metadata(tagged)
        assert parse_metadata(written, None, "x") == tagged
        model = written["master"]["picture"]["frameArray"][0]["frame"]["metadata"]["camera"]["model"]
        assert model == {"ILLUM": "B01", "F01": "F01"}[metadata.model]


def test_frame_without_optional_fields_gets_the_documented_values(illum: FrameMetadata) -> None:
    public = public_metadata(illum)
    for path in (
        "camera.make",
        "camera.firmware",
        "image.color.whiteBalanceGain",
        "image.modulationExposureBias",
        "devices.sensor.normalizedResponses",
        "devices.sensor.perCcm",
        "devices.clock",
        "devices.mla.rotation",
        "devices.mla.scaleFactor",
        "devices.mla.sensorOffset.x",
        "devices.mla.sensorOffset.y",
        "devices.lens.exitPupilOffset",
        "devices.shutter",
        "algorithms",
    ):
        public = without(public, path)
    found = parse_metadata(public, None, "x")
    assert (found.make, found.firmware, found.serial, found.captured_at) == ("", "", "", "")
    assert found.white_balance == found.normalized_responses == (1.0, 1.0, 1.0, 1.0)
    assert found.exposure_bias_ev == 0.0
    assert (found.lenslets.rotation_rad, found.lenslets.scale_x, found.lenslets.scale_y) == (0.0, 1.0, 1.0)
    assert found.lenslets.offset_m == (0.0, 0.0, illum.lenslets.offset_m[2])
    assert found.lens.exit_pupil_offset_m == EXIT_PUPIL_AT_INFINITY_M
    assert (found.ccm_by_cct, found.awb_cct_k, found.exposure_s) == ((), None, None)


@pytest.mark.parametrize(
    "path",
    [
        "camera.model",
        "image.width",
        "image.height",
        "image.iso",
        "image.pixelFormat.black.gb",
        "image.pixelFormat.white",
        "image.pixelPacking.bitsPerPixel",
        "image.pixelPacking.endianness",
        "image.mosaic.tile",
        "image.mosaic.upperLeftPixel",
        "image.color.ccm",
        "devices.sensor.pixelPitch",
        "devices.mla.lensPitch",
        "devices.mla.sensorOffset.z",
        "devices.lens.focalLength",
        "devices.lens.fNumber",
        "devices.lens.zoomStep",
        "devices.lens.focusStep",
        "devices.lens.infinityLambda",
    ],
)
def test_missing_field_is_named(illum: FrameMetadata, path: str) -> None:
    with pytest.raises(MetadataError, match=rf"A\.LFR: field '{path}'.* is missing"):
        parse_metadata(without(public_metadata(illum), path), None, "A.LFR")


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("image.width", 0, "found 0 x 40, expected 2 to 65535 each"),
        ("image.height", 10**9, "found 48 x 1000000000, expected 2 to 65535"),
        ("image.width", 48.5, "field 'image.width': found 48.5, expected a whole number"),
        ("image.width", True, "field 'image.width': found True, expected a finite number"),
        ("image.iso", float("nan"), "field 'image.iso': found nan, expected a finite number"),
        ("image.iso", 10**400, "field 'image.iso': found 1000.*, expected a finite number"),
        ("image.iso", -1, "field 'image.iso': found -1.0, expected a number above 0"),
        ("camera.make", 5, "field 'camera.make': found 5, expected a text"),
        ("camera.model", "D800", "field 'camera.model': found 'D800', expected 'B01' or 'ILLUM' or 'F01'"),
        ("image.pixelPacking.bitsPerPixel", 11, "bitsPerPixel: found 11, expected 8, 10, 12 or 16"),
        ("image.pixelPacking.endianness", "middle", "found 'middle', expected 'little' or 'big'"),
        ("image.mosaic.tile", "monochrome", "found 'monochrome', expected 'r,gr:gb,b'"),
        ("image.mosaic.upperLeftPixel", "g", "found 'g', expected 'r' or 'gr' or 'gb' or 'b'"),
        ("image.pixelFormat.black", 64, "found 64, expected an object with r, gr, gb, b"),
        ("image.pixelFormat.black", {"r": 64, "gr": 64, "gb": 1023, "b": 64}, "expected 0 <= black < white <= 65535"),
        ("image.color.ccm", [1.0] * 8, "expected a list of 9 numbers"),
        ("image.color.ccm", ["1"] * 9, r"field 'image.color.ccm.0': found '1', expected a finite number"),
        ("devices.sensor.perCcm", {"cct": 1}, "field 'devices.sensor.perCcm': found .*, expected a list"),
        ("devices.shutter.pixelExposureDuration", 0, "found 0.0, expected a number above 0"),
        (
            "parameters",
            {"vendorContent": {"com.lytro.tags": {"darkFrame": "no"}}},
            "found 'no', expected true or false",
        ),
    ],
)
def test_impossible_value_is_named(illum: FrameMetadata, path: str, value: object, message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        parse_metadata(changed(public_metadata(illum), path, value), None, "A.LFR")


def test_serial_number_that_is_no_text_is_refused(illum: FrameMetadata) -> None:
    with pytest.raises(MetadataError, match=r"field 'camera\.serialNumber': found 5, expected a text"):
        parse_metadata(public_metadata(illum), {"camera": {"serialNumber": 5}}, "A.LFR")


@pytest.mark.parametrize("public", [{}, {"image": "none"}, {"master": {"picture": {"frameArray": [{"frame": 1}]}}}])
def test_json_of_something_else_is_refused(public: dict[str, Any]) -> None:
    with pytest.raises(
        MetadataError, match=r"A\.TXT: field 'image' is missing; expected the metadata of a Lytro frame"
    ):
        parse_metadata(public, None, "A.TXT")


def read_real(real_data: Path, name: str) -> FrameMetadata:
    path = real_data / "raw" / "illum_metadata" / name
    return parse_metadata(json.loads(path.read_text()), None, name)


def test_real_illum_white_image(real_data: Path) -> None:
    found = read_real(real_data, "MOD_0015.TXT")
    assert (found.model, found.serial, found.is_white_image) == ("ILLUM", "B5152102610", True)
    assert (found.width, found.height, found.bits_per_pixel, found.bayer) == (7728, 5368, 10, "grbg")
    assert (found.lens.zoom_step, found.lens.focus_step) == (-560, -20)
    assert found.normalized_responses == (0.7437664270401001, 1.0, 1.0, 0.7596521377563477)
    assert found.lenslets.rotation_rad == 0.0009425521711818874
    assert read_real(real_data, "lenslet_whiteimage.TXT").serial == "B5143909630"


def test_real_flattened_file_is_the_picture_not_its_white_image(real_data: Path) -> None:
    found = read_real(real_data, "toy.json")
    assert (found.width, found.height, found.bits_per_pixel) == (7728, 5368, 10)
    assert (found.serial, found.black, found.iso) == ("B5152102610", (66.0,) * 4, 1635.0)
    assert (found.awb_cct_k, found.exposure_bias_ev, found.is_white_image) == (6500.0, -0.2876701056957245, False)
    assert found.lens.focal_length_m == 0.03717608642578125  # only its white image tells


def test_real_f01_frame(real_data: Path) -> None:
    found = read_real(real_data, "IMG_0001__frame.json")
    assert (found.model, found.bits_per_pixel, found.endianness, found.bayer) == ("F01", 12, "big", "bggr")
    assert (found.black[0], found.white[0], found.serial) == (168.0, 4095.0, "")
    assert found.lenslets.pitch_m / found.pixel_pitch_m == pytest.approx(9.9276, abs=1e-4)
