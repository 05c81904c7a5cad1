"""The summary table and page."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np

from lfstereo.batch.captures import CaptureFile
from lfstereo.batch.figures import THUMBNAIL, write_thumbnail
from lfstereo.batch.jobs import Outcome
from lfstereo.batch.pairing import Leftover
from lfstereo.batch.record import Entry
from lfstereo.batch.summary import SummaryRow, write_summary
from lfstereo.viewer.template import read_content


def rows() -> list[SummaryRow]:
    done = Outcome(
        "a&b", "done", figures={"valid_share": 0.91, "mae_px": 2.5}, seconds={"x": 1.0, "y": 2.0}, peak_gib=2.1
    )
    failed = Outcome("c", "failed", "x.LFR: cut off, <bad>")
    return [
        SummaryRow("a&b", "done", Entry(done, "f", "")),
        SummaryRow("c", "failed", Entry(failed, "", "")),
        SummaryRow("d", "not done", None),
    ]


def test_table(tmp_path: Path) -> None:
    write_summary(tmp_path, rows(), [])
    with (tmp_path / "summary.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["state"] for row in table] == ["done", "failed", "not done"]
    assert (table[0]["seconds"], table[0]["valid_share"], table[0]["mae_px"]) == ("3.0", "0.91", "2.5")
    assert table[1]["reason"] == "x.LFR: cut off, <bad>"
    assert "bad_4_percent" not in table[0]


def test_page(tmp_path: Path) -> None:
    alone = Leftover("unpaired", (CaptureFile(tmp_path / "e.LFR", Path("e.LFR")),), "no other <capture>")
    write_summary(tmp_path, rows(), [alone])
    content = read_content(tmp_path / "summary.html")
    assert content["lede"] == "1 done, 1 failed, 1 not done."
    done, failed, waiting = content["pairs"]
    assert (done["name"], done["page"], done["picture"]) == ("a&b", "a%26b/report.html", "a%26b/thumbnail.jpg")
    shown = dict(zip([column["name"] for column in content["columns"]], done["figures"], strict=True))
    assert (shown["valid_share"], shown["mae_px"], shown["depth_low_m"]) == (0.91, 2.5, None)
    assert (done["seconds"], done["peak_gib"]) == (3.0, 2.1)
    assert failed == {"name": "c", "state": "failed", "reason": "x.LFR: cut off, <bad>"}
    assert waiting == {"name": "d", "state": "not done"}
    assert content["left_out"] == [["unpaired", "e.LFR", "no other <capture>"]]
    assert content["files"][0]["bytes"] == (tmp_path / "summary.csv").stat().st_size
    assert "<bad>" not in (tmp_path / "summary.html").read_text()


def test_thumbnail_shows_both_pictures(tmp_path: Path) -> None:
    map_and_scale = np.full((434, 725, 3), 50, np.uint8)
    map_and_scale[:, 625:] = 255
    cv2.imwrite(str(tmp_path / "all_in_focus.png"), np.full((434, 625, 3), 200, np.uint8))
    cv2.imwrite(str(tmp_path / "disparity_colour.png"), map_and_scale)
    write_thumbnail(tmp_path)
    picture = cv2.imread(str(tmp_path / THUMBNAIL))
    height, width = picture.shape[:2]
    assert (height, width) == (120, 2 * 173)
    np.testing.assert_allclose(picture[:, : width // 2 - 8], 200, atol=3)
    np.testing.assert_allclose(picture[:, width // 2 + 8 :], 50, atol=3)
