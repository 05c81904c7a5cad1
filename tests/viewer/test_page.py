"""The result page: one file, nothing from elsewhere, and the numbers that the run computed."""

from __future__ import annotations

import base64
import hashlib
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lfstereo.errors import ContainerError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.viewer.content import encode_result
from lfstereo.viewer.embedding import array_text, jpeg_uri, mask_text, picture_from_uri
from lfstereo.viewer.template import fill_page, read_content

from .conftest import DOFFS_PX, FAR_PX, NEAR_PX, UNCERTAINTY_PX, disparity, pair_result, texture

SIZE_LIMIT_BYTES = 25 * 2**20
JPEG_MEAN_CODES = 4.0
"""Mean difference after JPEG of a picture full of noise."""


def test_holds_what_the_run_computed(result_folder: Path) -> None:
    page = result_folder / "report.html"
    assert page.stat().st_size < SIZE_LIMIT_BYTES
    content = read_content(page)
    codes = np.frombuffer(base64.b64decode(content["disparity"]["values"]), "<u2")
    np.testing.assert_array_equal(codes * content["disparity"]["px_per_code"], disparity().ravel())
    valid = np.unpackbits(np.frombuffer(base64.b64decode(content["disparity"]["valid"]), np.uint8))
    assert valid[: disparity().size].reshape(disparity().shape)[:, 4:].all()
    assert not valid[: disparity().size].reshape(disparity().shape)[:, :4].any()
    assert content["geometry"]["doffs_px"] == pytest.approx(DOFFS_PX)
    assert [s["disparity"] for s in content["slices"]] == pytest.approx(np.linspace(90, 0, 16).tolist())
    assert len(content["views"]) == 21
    assert content["title"] == ["left <b>.h5", "right & co.h5"]
    assert {"mesh.glb", "point_cloud.ply", "run.toml", "focal_stack_left/"} <= {f["name"] for f in content["files"]}
    assert all((result_folder / f["href"]).exists() for f in content["files"])
    sharp = picture_from_uri(content["pictures"]["sharp"])
    assert np.abs(sharp.astype(float) - srgb8(texture())).mean() < JPEG_MEAN_CODES


def overlay(content: dict[str, Any], name: str) -> dict[str, Any]:
    (found,) = (one for one in content["overlays"] if one["id"] == name)
    return dict(found)


def test_doubt_is_the_distance_to_the_second_method(result_folder: Path) -> None:
    """The right view is the left one moved by 20 px everywhere: near the far half's 18 px, far from the near's 60."""
    doubt = overlay(read_content(result_folder / "report.html"), "doubt")
    codes = np.frombuffer(base64.b64decode(doubt["values"]), np.uint8).reshape(disparity().shape)
    answered = codes[:, 100:] != 255
    assert answered.mean() > 0.3
    assert np.median(codes[:, 100:][answered]) * doubt["px_per_code"] == pytest.approx(20.0 - FAR_PX, abs=0.3)
    near = codes[:, 30:60]
    assert (near[near != 255] * doubt["px_per_code"] > 0.3 * (NEAR_PX - 20.0)).all()


def test_uncertainty_is_shown_where_the_map_has_it(result_folder: Path) -> None:
    told = overlay(read_content(result_folder / "report.html"), "uncertainty")
    codes = np.frombuffer(base64.b64decode(told["values"]), np.uint8).reshape(disparity().shape)
    assert (codes[:, :4] == 255).all(), "no answer where one camera alone sees"
    assert codes[0, 10] * told["px_per_code"] == UNCERTAINTY_PX[0]
    assert codes[0, -1] * told["px_per_code"] == UNCERTAINTY_PX[1]
    silent = replace(pair_result(), map=replace(pair_result().map, uncertainty_px=None))
    assert [one["id"] for one in encode_result(silent).parts["overlays"]] == ["doubt"]


def test_reaches_nothing_outside(result_folder: Path) -> None:
    text = (result_folder / "report.html").read_text("utf-8")
    without_content = re.sub(r'<script type="application/json".*?</script>', "", text, flags=re.DOTALL)
    assert set(re.findall(r"https?://[^\s\"'<>`)]+", without_content)) <= {"http://www.w3.org/2000/svg"}
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy
    assert "default-src 'none'" in policy[1]
    for tag, kind in (("style", "style-src"), ("script", "script-src")):
        inside = re.search(rf"<{tag}>(.*?)</{tag}>", text, re.DOTALL)
        assert inside
        digest = base64.b64encode(hashlib.sha256(inside[1].encode()).digest()).decode()
        assert f"{kind} 'sha256-{digest}'" in policy[1]


def test_names_of_files_are_no_markup(result_folder: Path) -> None:
    text = (result_folder / "report.html").read_text("utf-8")
    assert "left <b>" not in text
    assert "<title>left &lt;b&gt;.h5 / right &amp; co.h5" in text


def test_content_survives_a_page() -> None:
    content = {"title": ["</script><script>alert(1)</script>", "@STYLE@"], "value": 1.5}
    page = fill_page(content)
    assert "<script>alert" not in page
    path = Path(__file__)
    assert page.count("@STYLE@") == 2, f"once in the title, once in the content; see {path.name}"


def test_refuses_other_pages(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    with pytest.raises(ContainerError, match="cannot be read"):
        read_content(page)
    page.write_text("<html></html>")
    with pytest.raises(ContainerError, match="found no result"):
        read_content(page)
    page.write_text('<script type="application/json" id="content">{"title"</script>')
    with pytest.raises(ContainerError, match="damaged"):
        read_content(page)


def test_refuses_what_is_no_picture() -> None:
    for uri in ("data:image/jpeg;base64,AAAA", "data:image/jpeg;base64,@@", "http://example.org/a.jpg", ""):
        with pytest.raises(ContainerError, match="expected a JPEG"):
            picture_from_uri(uri)


def test_pictures_and_arrays_as_text() -> None:
    grey = np.full((6, 5, 3), (10, 120, 240), np.uint8)
    assert np.abs(picture_from_uri(jpeg_uri(grey)).astype(int) - grey).max() <= 3
    assert base64.b64decode(array_text(np.array([1, 258], np.uint16))) == b"\x01\x00\x02\x01"
    assert base64.b64decode(mask_text(np.array([[True, False, True]]))) == b"\xa0"
