"""The pages of a calibration and of a batch in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lfstereo.batch.captures import CaptureFile
from lfstereo.batch.figures import THUMBNAIL
from lfstereo.batch.jobs import Outcome
from lfstereo.batch.pairing import Leftover
from lfstereo.batch.record import Entry
from lfstereo.batch.summary import SummaryRow, write_summary
from lfstereo.viewer.template import fill_page

from .browser import Page


def camera(name: str, x_m: float) -> dict[str, Any]:
    corners = [[x_m + 0.2 * dx, 0.15 * dy, 0.4] for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return {
        "name": name,
        "serial": f"{name} <b>",
        "size_px": [600, 400],
        "seen": [[x_m, 0, 0], *corners],
        "covered": 0.5,
        "residual_places": [[25.0, 25.0], [325.0, 225.0]],
        "residuals": [[0.05, 0.0], [-0.02, 0.1]],
        "lens": {"focal length, mm": [20.1, 20.0]},
        "settings": {"focal_px": [420.0, 421.0], "zoom step": "not known"},
    }


def shot(name: str, z_m: float, rms_px: float) -> dict[str, Any]:
    return {
        "name": name,
        "outline": [[-0.1, -0.1, z_m], [0.1, -0.1, z_m], [0.1, 0.1, z_m], [-0.1, 0.1, z_m]],
        "rms_px": [rms_px, 0.1],
        "corners": [42, 40],
        "views": [9, 9],
        "distance_m": z_m,
        "tilt_deg": 12.0,
        "places": [[[20.0, 30.0], [300.0, 200.0]], [[40.0, 30.0]]],
    }


CALIBRATION: dict[str, Any] = {
    "title": ["left <b>", "right <b>"],
    "lede": "3 shots of both cameras.",
    "made": "lfstereo",
    "cells": [12, 8],
    "cameras": [camera("left", 0.0), camera("right", 0.1)],
    "shots": [shot("first", 0.6, 0.2), shot("second", 0.8, 0.9), shot("third", 1.0, 0.3)],
    "rig": {
        "baseline_m": 0.094912,
        "baseline_sd_m": 4e-6,
        "rotation_deg": [0.1, 6.3, -0.2],
        "rotation_sd_deg": [0.002, 0.004, 0.001],
        "turn_deg": 6.31,
        "sigma_px": 0.21,
        "near_m": 0.6,
        "far_m": 1.0,
    },
    "left_out": [["fourth", "contradicts the other shots"]],
    "files": [{"name": "rig.toml", "href": "rig.toml", "about": "the rig", "bytes": 900}],
}


@pytest.fixture
def calibration(page: Page, tmp_path: Path) -> Iterator[Page]:
    path = tmp_path / "rig.html"
    path.write_text(fill_page(CALIBRATION, "calibration"), "utf-8")
    page.open(path.as_uri())
    yield page
    assert page.complaints() == []
    assert {asked.split("#")[0] for asked in page.requests()} == {path.as_uri()}


def test_calibration_tells_the_rig_and_its_worst_shot(calibration: Page) -> None:
    assert "94.9120 mm" in calibration.text("panel")
    assert "± 0.0040 mm" in calibration.text("panel")
    assert "second" in calibration.text("readout") and "0.90 px" in calibration.text("readout")
    assert calibration.text("title") == "left <b> / right <b>"
    told = calibration.text("sheets")
    for words in ("contradicts the other shots", "20.10", "rig.toml", "50 % of the frame"):
        assert words in told


def test_boards_are_drawn_turn_and_are_chosen_by_a_click(calibration: Page) -> None:
    assert calibration.colours("space") > 8
    first = calibration.picture("space")
    calibration.key("ArrowLeft")
    turned = calibration.picture("space")
    calibration.key("+")
    nearer = calibration.picture("space")
    assert len({first, turned, nearer}) == 3
    calibration.run("document.querySelectorAll('.shots tbody tr')[2].focus()")
    assert "third" in calibration.text("readout")
    calibration.key(",")
    assert "second" in calibration.text("readout")
    marked = "return document.querySelectorAll('.places.chosen').length"
    assert calibration.run(marked) == 2, "one in the frame of either camera"
    hits = calibration.run(
        """
        const stage = document.getElementById("stage"), hits = [];
        stage.scrollIntoView({ block: "center" });
        const box = stage.getBoundingClientRect();
        for (let y = 8; y < box.height; y += 12) for (let x = 8; x < box.width; x += 12) {
          const at = { clientX: box.x + x, clientY: box.y + y };
          stage.dispatchEvent(new PointerEvent("pointermove", at));
          if (stage.style.cursor === "pointer") hits.push([at.clientX, at.clientY]);
        }
        return hits;
        """
    )
    chosen = set()
    for x, y in hits[:: max(1, len(hits) // 12)]:
        for kind in ("mousePressed", "mouseReleased"):
            told = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
            calibration.driver.execute_cdp_cmd("Input.dispatchMouseEvent", told)
        chosen.add(calibration.text("readout").split(" Left")[0])
    assert len(chosen) >= 2


@pytest.fixture
def batch(page: Page, tmp_path: Path) -> Iterator[Page]:
    rows = []
    for number, mae in enumerate((2.5, 1.5, 10.0)):
        name = f"scene & {number}"
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / THUMBNAIL), np.full((120, 346, 3), 90 + 40 * number, np.uint8))
        figures = {"valid_share": 0.9, "mae_px": mae, "depth_low_m": 0.6}
        warnings = ("dark <i>",) if number == 1 else ()
        done = Outcome(name, "done", figures=figures, seconds={"x": 2.0 + number}, peak_gib=2.1, warnings=warnings)
        rows.append(SummaryRow(name, "done", Entry(done, "f", "")))
    rows.append(SummaryRow("broken", "failed", Entry(Outcome("broken", "failed", "x.LFR: cut off"), "", "")))
    alone = Leftover("unpaired", (CaptureFile(tmp_path / "e.LFR", Path("e.LFR")),), "no other capture")
    write_summary(tmp_path, rows, [alone])
    page.open((tmp_path / "summary.html").as_uri())
    yield page
    assert page.complaints() == []
    assert all(asked.startswith(tmp_path.as_uri()) for asked in page.requests())


def names(page: Page) -> list[str]:
    script = """
        const rows = [...document.querySelectorAll("#pairs tbody tr")];
        return rows.map((row) => (row.querySelector("a") || row.querySelector("td")).innerText);
    """
    return [str(name) for name in page.run(script)]


def press(page: Page, words: str) -> None:
    script = "[...document.querySelectorAll('main button')].find(b => b.innerText.startsWith(arguments[0])).click()"
    page.run(script, words)


def test_batch_is_sorted_sieved_and_searched(batch: Page) -> None:
    assert names(batch) == ["scene & 0", "scene & 1", "scene & 2", "broken"]
    press(batch, "MEAN ERROR")
    assert names(batch) == ["scene & 1", "scene & 0", "scene & 2", "broken"]
    press(batch, "MEAN ERROR")
    assert names(batch) == ["scene & 2", "scene & 0", "scene & 1", "broken"]
    press(batch, "Failed")
    assert names(batch) == ["broken"]
    assert "x.LFR: cut off" in batch.text("pairs")
    press(batch, "All")
    batch.slide("search", "dark <i>")  # type: ignore[arg-type]
    assert names(batch) == ["scene & 1"]
    assert "no other capture" in batch.text("sheets")


def test_batch_shows_small_pictures(batch: Page) -> None:
    loaded = "return [...document.images].filter(i => i.complete && i.naturalWidth === 346).length"
    batch.until(lambda: batch.run(loaded) == 3)


@pytest.mark.parametrize("kind", ["calibration", "batch"])
def test_narrow_screens_do_not_scroll_sideways(kind: str, page: Page, request: pytest.FixtureRequest) -> None:
    request.getfixturevalue(kind)
    size = {"width": 390, "height": 800, "deviceScaleFactor": 2, "mobile": True}
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        assert page.run("return document.documentElement.scrollWidth") <= 390
    finally:
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
