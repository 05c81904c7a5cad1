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
    page = (tmp_path / "summary.html").read_text()
    assert "1 done, 1 failed, 1 not done" in page
    assert "src='a%26b/thumbnail.jpg'" in page
    assert "a&amp;b" in page
    assert "cut off, &lt;bad&gt;" in page
    assert "no other &lt;capture&gt;" in page
    assert "<bad>" not in page


def test_thumbnail_shows_both_pictures(tmp_path: Path) -> None:
    for name, level in (("all_in_focus.png", 200), ("disparity_colour.png", 50)):
        cv2.imwrite(str(tmp_path / name), np.full((434, 625, 3), level, np.uint8))
    write_thumbnail(tmp_path)
    picture = cv2.imread(str(tmp_path / THUMBNAIL))
    height, width = picture.shape[:2]
    assert (height, width) == (120, 2 * 173)
    np.testing.assert_allclose(picture[:, : width // 2 - 8], 200, atol=3)
    np.testing.assert_allclose(picture[:, width // 2 + 8 :], 50, atol=3)
