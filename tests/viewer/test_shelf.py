"""What of a folder can be looked at, and what opening it gives."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest

from lfstereo.errors import AssetError, ContainerError
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import write_light_field
from lfstereo.lightfield.views_folder import write_views_folder
from lfstereo.viewer.opened import open_item
from lfstereo.viewer.shelf import Item, find_items
from lfstereo.viewer.template import read_content

from .conftest import COLUMNS, NEAR_PX, ROWS, SLOPE_FROM_DISPARITY, light_field

SLOPE_STEP = 0.1
"""What five views across tell, px per view."""


def test_lists_results_fields_and_captures(tmp_path: Path, result_folder: Path) -> None:
    for name in ("b/two.LFR", "b/MOD_0001.RAW", "a.h5", "notes.txt", ".hidden.h5", ".x/one.lfp"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "report.html").write_text("")
    (tmp_path / "c" / "inside.h5").write_text("")
    found = [(item.name, item.kind) for item in find_items(tmp_path)]
    assert found == [("a.h5", "light field"), ("b/two.LFR", "capture"), ("c", "result")]
    assert [item.kind for item in find_items(tmp_path / "c")] == ["result"]
    assert [item.kind for item in find_items(tmp_path / "b" / "MOD_0001.RAW")] == ["capture"]
    assert [item.name for item in find_items(result_folder)] == ["a result"]


def test_links_out_of_the_folder_are_left_out(tmp_path: Path, field_file: Path) -> None:
    (tmp_path / "shelf").mkdir()
    (tmp_path / "shelf" / "out.h5").symlink_to(field_file)
    (tmp_path / "shelf" / "own.h5").write_bytes(b"")
    (tmp_path / "shelf" / "own_again.h5").symlink_to(tmp_path / "shelf" / "own.h5")
    assert [item.name for item in find_items(tmp_path / "shelf")] == ["own.h5", "own_again.h5"]


def test_nothing_to_look_at(tmp_path: Path) -> None:
    with pytest.raises(ContainerError, match="no such file or folder"):
        find_items(tmp_path / "none")
    with pytest.raises(ContainerError, match=r"found no report\.html"):
        find_items(tmp_path)


def test_opens_a_result(result_folder: Path) -> None:
    opened = open_item(find_items(result_folder)[0])
    assert opened.content == read_content(result_folder / "report.html")
    assert opened.slope_from_axis == pytest.approx(SLOPE_FROM_DISPARITY)
    assert opened.live is not None
    assert opened.live.codes.shape[0] == 21
    assert opened.folder == result_folder


def test_opens_a_light_field_and_a_folder_of_views(field_file: Path, tmp_path: Path) -> None:
    opened = open_item(find_items(field_file)[0])
    assert opened.content["size"] == [ROWS, COLUMNS]
    assert opened.content["disparity"] is None
    assert opened.live is not None
    slopes = opened.content["slopes"]
    codes = np.frombuffer(base64.b64decode(slopes["values"]), "<u2").reshape(ROWS, COLUMNS)
    near = slopes["lowest"] + slopes["slope_per_code"] * codes[48, 30]
    assert near == pytest.approx(SLOPE_FROM_DISPARITY[0] * NEAR_PX + SLOPE_FROM_DISPARITY[1], abs=SLOPE_STEP)
    assert opened.content["axis"]["near"] > 0.4 > -0.44 > opened.content["axis"]["far"]
    json.dumps(opened.content, allow_nan=False)
    write_views_folder(tmp_path / "views", light_field(3))
    (item,) = find_items(tmp_path / "views")
    assert open_item(item).content["record"]["field"]["views"] == "3 × 3"


def test_a_lone_view_is_not_refocused(tmp_path: Path) -> None:
    lone = LightField(np.full((1, 1, 8, 9, 3), 0.2, np.float32), None, None, "", "lone")
    write_light_field(tmp_path / "lone.h5", lone)
    opened = open_item(find_items(tmp_path / "lone.h5")[0])
    assert opened.live is None
    assert len(opened.content["views"]) == 1


def test_damaged_page(tmp_path: Path) -> None:
    page = '<script type="application/json" id="content">{"title": [], "views": [{"s": 0}]}</script>'
    (tmp_path / "report.html").write_text(page)
    with pytest.raises(ContainerError, match="damaged"):
        open_item(Item("x", tmp_path, "result"))


def test_a_capture_needs_white_images(tmp_path: Path) -> None:
    capture = tmp_path / "one.LFR"
    capture.write_bytes(b"no container")
    with pytest.raises((AssetError, ContainerError), match=r"one\.LFR"):
        open_item(find_items(capture)[0])
