"""The small files beside the white images: what they say, and what a damaged one is answered."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lfstereo.container.factory_files import (
    parse_factory_lattices,
    parse_hot_pixels,
    parse_manifest,
    parse_serial,
)
from lfstereo.errors import ContainerError, LfstereoError, MetadataError

LATTICES: dict[str, Any] = {
    "zoomPosition": [-600, 0],
    "numFocusPositions": [2, 1],
    "focusPosition": [[10, 400], [20]],
    "xDiskOriginPixels": [[3860.5, 3861], [3862]],
    "yDiskOriginPixels": [[2680, 2681], [2682]],
    "xDiskStepPixelsX": [[14.3, 14.31], [14.32]],
    "xDiskStepPixelsY": [[0.01, 0.02], 0.03],
    "yDiskStepPixelsX": [[7.1, 7.2], [7.3]],
    "yDiskStepPixelsY": [[12.3, 12.4], [12.5]],
}


def test_serial() -> None:
    assert parse_serial(b'{"camera": {"serialNumber": "B5143909630"}}\0\0', "unit_info.json") == "B5143909630"
    with pytest.raises(MetadataError, match=r"camera\.serialNumber: found None"):
        parse_serial(b'{"camera": {}}', "unit_info.json")


def test_hot_pixels() -> None:
    none = parse_hot_pixels(bytes(4), "HOTPIXEL.BIN")
    assert none.shape == (0, 2)
    for data in (b"", bytes(3), bytes([1, 0, 0, 0, 5, 0]), bytes(8)):
        with pytest.raises(ContainerError, match="hot pixels; copy it again"):
            parse_hot_pixels(data, "HOTPIXEL.BIN")


def test_factory_lattices() -> None:
    found = parse_factory_lattices(json.dumps(LATTICES).encode(), "mla_calibration.json")
    assert [(lattice.zoom_step, lattice.focus_step) for lattice in found] == [(-600, 10), (-600, 400), (0, 20)]
    assert found[1].origin_px == (3861.0, 2681.0)
    assert found[2].step_x_px == (14.32, 0.03)
    assert found[0].step_y_px == (7.1, 12.3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"zoomPosition": "0"}, "zoomPosition: found no list of numbers"),
        ({"xDiskStepPixelsX": [[1, 2]]}, "found no table of 2 rows"),
        ({"xDiskStepPixelsX": [[1, 2], ["a"]]}, "something else than numbers"),
        ({"xDiskStepPixelsX": [[1], [2]]}, "tables of different lengths at zoom -600"),
    ],
)
def test_damaged_lattices(change: dict[str, Any], message: str) -> None:
    with pytest.raises(MetadataError, match=message):
        parse_factory_lattices(json.dumps(LATTICES | change).encode(), "mla_calibration.json")


def test_manifest() -> None:
    files = [{"name": "MOD_0015.GCT", "hash": "sha1-DD0A"}, {"name": "MOD_0016.GCT", "hash": "sha1-ee"}, {"name": 3}]
    found = parse_manifest(json.dumps({"calibrationFiles": files}).encode(), "cal_file_manifest.json")
    assert found == {"sha1-dd0a": "MOD_0015", "sha1-ee": "MOD_0016"}
    with pytest.raises(MetadataError, match="calibrationFiles: found NoneType"):
        parse_manifest(b"{}", "cal_file_manifest.json")


def test_all_refuse_what_is_no_json() -> None:
    for parse in (parse_serial, parse_factory_lattices, parse_manifest):
        with pytest.raises(LfstereoError, match="no valid JSON"):
            parse(b"\xff\xfe", "file")
