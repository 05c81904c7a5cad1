"""The page in a real browser: what a hand on it does, and that it asks nobody for anything."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from lfstereo.conventions import depth_from_disparity
from lfstereo.network.shipped import DEFAULT_MODEL
from lfstereo.viewer.server import PageServer
from lfstereo.viewer.shelf import find_items

from .browser import Page
from .conftest import BASELINE_M, DOFFS_PX, FAR_PX, FOCAL_PX, NEAR_PX, ROWS, UNCERTAINTY_PX

HALF_SLICE_PX = 3.01
LEFT, RIGHT = (35, 48), (105, 48)
"""A pixel of the near half and one of the far half."""


@pytest.fixture(scope="module")
def address(result_folder: Path) -> str:
    return (result_folder / "report.html").as_uri()


@pytest.fixture
def result(page: Page, address: str) -> Iterator[Page]:
    """The result page from its file; whatever a test does, nothing complains and nobody else is asked."""
    page.open(address)
    yield page
    assert page.complaints() == []
    assert {asked.split("#")[0].split("?")[0] for asked in page.requests()} == {address}


def focused_px(page: Page) -> float:
    found = re.search(r"([\d.]+) px", page.text("focus-reading"))
    assert found
    return float(found[1])


def test_slider_moves_the_focus(result: Page) -> None:
    result.mode("focus")
    shown = []
    for share in (0.0, 0.5, 1.0):
        result.slide("focus-scale", share)
        shown.append(result.until(lambda: result.colours("picture") > 50 and result.picture()))
    assert len(set(shown)) == 3
    assert "slice 16 of 16" in result.text("focus-reading")
    assert focused_px(result) == 0.0
    result.key("ArrowLeft")
    assert "slice 15 of 16" in result.text("focus-reading")


@pytest.mark.parametrize(("place", "expected_px"), [(LEFT, NEAR_PX), (RIGHT, FAR_PX)])
def test_a_click_brings_a_point_into_focus(result: Page, place: tuple[int, int], expected_px: float) -> None:
    result.mode("focus")
    result.click(*place)
    result.until(lambda: abs(focused_px(result) - expected_px) <= HALF_SLICE_PX)
    metres = depth_from_disparity(focused_px(result), FOCAL_PX, BASELINE_M, DOFFS_PX)
    assert float(result.text("focus-reading").split()[0]) == pytest.approx(metres, abs=6e-4)


@pytest.mark.parametrize(("place", "expected_px"), [(LEFT, NEAR_PX), (RIGHT, FAR_PX)])
def test_the_value_under_the_cursor(result: Page, place: tuple[int, int], expected_px: float) -> None:
    result.mode("depth")
    result.mouse("mouseMoved", *place)
    result.until(lambda: result.text("reading-disparity") == f"{expected_px:.2f} px")
    metres = depth_from_disparity(expected_px, FOCAL_PX, BASELINE_M, DOFFS_PX)
    assert result.text("reading-depth") == f"{metres:.3f} m"
    assert result.text("reading-valid") == "yes"
    assert result.run("return getComputedStyle(document.getElementById('needle')).opacity") == "1"
    result.mouse("mouseMoved", 1, 40)
    result.until(lambda: result.text("reading-valid") == "no")


def test_keys_read_values_too(result: Page) -> None:
    result.mode("depth")
    result.key("ArrowRight")
    result.until(lambda: result.text("reading-disparity") == f"{FAR_PX:.2f} px")


def test_overlays(result: Page) -> None:
    result.mode("depth")
    shown = [result.until(lambda: result.colours("picture") >= 3 and result.picture())]
    for name, words in (("Second method", "no proof"), ("Uncertainty", "expects its own disparity")):
        result.choose(name)
        shown.append(result.picture())
        assert words in result.text("overlay")
    result.key("+")
    shown.append(result.picture())
    assert len(set(shown)) == 4
    result.mouse("mouseMoved", *RIGHT)
    result.until(lambda: result.text("reading-uncertainty") == f"{UNCERTAINTY_PX[1]:.2f} px")
    result.choose("Disparity")
    assert result.text("overlay") == ""


def test_perspective_follows_a_drag_and_a_finger(result: Page) -> None:
    result.mode("views")
    shown = [result.until(lambda: result.colours("picture") > 50 and result.picture())]
    result.drag((70, 48), (110, 48))
    shown.append(result.picture())
    x, y = result.at(70, 30)
    for kind, points in (
        ("touchStart", [{"x": x, "y": y}]),
        ("touchMove", [{"x": x, "y": y + 60}]),
        ("touchMove", [{"x": x - 20, "y": y + 160}]),
        ("touchEnd", []),
    ):
        result.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    shown.append(result.picture())
    assert len(set(shown)) == 3


def test_the_line_swipes(result: Page) -> None:
    result.mode("compare")
    shown = [result.until(lambda: result.colours("picture") > 50 and result.picture())]
    result.drag((70, 48), (20, 48))
    shown.append(result.picture())
    result.key("ArrowRight")
    shown.append(result.picture())
    assert len(set(shown)) == 3
    assert result.text("side-left") == "All in focus"


@pytest.mark.parametrize(("query", "name"), [("?draw=canvas", "canvas"), ("?draw=webgl", "WebGL2"), ("", "canvas")])
def test_points_are_drawn_and_turn(page: Page, address: str, query: str, name: str) -> None:
    page.open(address + query, "space")
    page.until(lambda: name in page.text("renderer"))
    assert page.colours("space-canvas") > 200
    first = page.picture("space-canvas")
    page.drag((70, 48), (100, 60))
    turned = page.picture("space-canvas")
    page.slide("point-size", 4.0)
    larger = page.picture("space-canvas")
    assert len({first, turned, larger}) == 3
    if name == "WebGL2":
        page.choose("Surface")
        assert page.picture("space-canvas") != larger
        assert page.colours("space-canvas") > 200
    assert page.complaints() == []


def test_dark_and_light(result: Page) -> None:
    def paper() -> object:
        return result.run("return getComputedStyle(document.body).backgroundColor")

    first = paper()
    result.key("t")
    second = paper()
    result.run("document.getElementById('theme').click()")
    assert paper() == first != second


def test_tells_figures_and_files(result: Page) -> None:
    text = result.text("sheets")
    for expected in ("Figures", "sure where the network tells", "mesh.glb", DEFAULT_MODEL, "write results"):
        assert expected.lower() in text.lower()
    assert result.text("title") == "left <b>.h5 / right & co.h5"


def test_narrow_screens_show_all_without_sideways_scrolling(result: Page) -> None:
    size = {"width": 390, "height": 800, "deviceScaleFactor": 2, "mobile": True}
    result.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        for mode in ("focus", "views", "depth", "space"):
            result.mode(mode)
            assert result.run("return document.documentElement.scrollWidth") <= 390
    finally:
        result.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_live_refocus_and_choice(page: Page, result_folder: Path, field_file: Path) -> None:
    with PageServer(find_items(result_folder.parent)) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            page.open(server.url, "focus")
            look_live(page)
            page.run("const c = document.getElementById('chooser'); c.value = 1; c.dispatchEvent(new Event('change'))")
            page.until(lambda: page.run("return document.getElementById('title').innerText") == "field.h5")
            page.until(lambda: page.run("return document.documentElement.dataset.ready") == "yes")
            look_live(page)
            page.click(*LEFT)
            assert "px per view" in page.text("reading-slope")
            page.until(lambda: 0.25 < float(page.text("focus-reading").split()[0].replace("−", "-")) < 0.55)
            assert page.complaints() == []
            assert all(asked.startswith(server.url) for asked in page.requests())
        finally:
            server.shutdown()
            thread.join()


def look_live(page: Page) -> None:
    """Move every live control and see the picture change each time."""
    last = page.until(lambda: page.colours("picture") > 50 and page.picture())
    for control, value in (
        ("focus-scale", 0.05),
        ("focus-scale", 0.95),
        ("aperture", 0.5),
        ("tilt-x", 0.3),
        ("aperture", 2.5),
    ):
        page.slide(control, value)
        if control != "tilt-x":
            last = page.until(lambda: (shown := page.picture()) != last and shown)  # noqa: B023
    assert page.run("return document.querySelector('.panel .action').innerText") == "Save as 16-bit PNG"
    assert page.run("return document.getElementById('picture').height") > ROWS
