"""The page in a real browser: what a hand on it does, and that it asks nobody for anything."""

from __future__ import annotations

import json
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from lfstereo.conventions import depth_from_disparity
from lfstereo.viewer.server import PageServer
from lfstereo.viewer.shelf import find_items

from .conftest import BASELINE_M, COLUMNS, DOFFS_PX, FAR_PX, FOCAL_PX, NEAR_PX, ROWS, UNCERTAINTY_PX

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
WAIT_S = 240.0
HALF_SLICE_PX = 3.01
LEFT, RIGHT = (35, 48), (105, 48)
"""A pixel of the near half and one of the far half."""
SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1280,1000",
)


class Page:
    """A page in the browser, and what can be done with it."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, address: str, mode: str = "sharp") -> None:
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self.driver.get_log("performance")
        self.driver.get(f"{address}#{mode}")
        self.until(lambda: self.run("return document.documentElement.dataset.ready") == "yes")

    def run(self, script: str, *values: object) -> Any:
        return self.driver.execute_script(script, *values)

    def until(self, holds: Callable[[], object]) -> Any:
        """Wait until something holds and return it."""
        end = time.monotonic() + WAIT_S
        while True:
            found = holds()
            if found:
                return found
            assert time.monotonic() < end, "the page did not get there in time"
            time.sleep(0.03)

    def mode(self, name: str) -> None:
        self.run("document.getElementById('mode-' + arguments[0]).click()", name)

    def text(self, name: str) -> str:
        return str(self.run("return document.getElementById(arguments[0]).innerText", name)).replace("\n", " ")

    def picture(self, canvas: str = "picture") -> str:
        """Return what a canvas shows after the next drawn frame."""
        script = """
            const [name, done] = arguments;
            requestAnimationFrame(() => requestAnimationFrame(() => done(document.getElementById(name).toDataURL())));
        """
        return str(self.driver.execute_async_script(script, canvas))

    def colours(self, canvas: str) -> int:
        """Return how many of 32768 colours a canvas shows."""
        script = """
            const from = document.getElementById(arguments[0]), to = document.createElement("canvas");
            to.width = from.width; to.height = from.height;
            const context = to.getContext("2d");
            context.drawImage(from, 0, 0);
            const data = context.getImageData(0, 0, to.width, to.height).data, found = new Set();
            for (let i = 0; i < data.length; i += 4) {
              found.add((data[i] >> 3) << 10 | (data[i + 1] >> 3) << 5 | data[i + 2] >> 3);
            }
            return found.size;
        """
        return int(self.run(script, canvas))

    def at(self, column: int, row: int) -> tuple[float, float]:
        """Return where on the screen the middle of a px of the picture lies."""
        self.run("document.getElementById('stage').scrollIntoView({ block: 'center' })")
        box = self.run("const b = document.getElementById('stage').getBoundingClientRect(); return [b.x, b.y, b.width]")
        scale = box[2] / COLUMNS
        return box[0] + (column + 0.5) * scale, box[1] + (row + 0.5) * scale

    def mouse(self, kind: str, column: int, row: int, **more: object) -> None:
        x, y = self.at(column, row)
        told = {"type": kind, "x": x, "y": y, "button": "left" if kind != "mouseMoved" or more else "none"} | more
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", told | {"clickCount": int(kind != "mouseMoved")})

    def click(self, column: int, row: int) -> None:
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.mouse(kind, column, row)

    def drag(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        self.mouse("mousePressed", *start, buttons=1)
        for share in (0.3, 0.7, 1.0):
            column, row = (round(a + share * (b - a)) for a, b in zip(start, end, strict=True))
            self.mouse("mouseMoved", column, row, buttons=1)
        self.mouse("mouseReleased", *end)

    def key(self, name: str) -> None:
        self.run("document.getElementById('stage').focus()")
        for kind in ("keyDown", "keyUp"):
            self.driver.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": kind, "key": name, "text": name[1:] and ""})

    def choose(self, words: str) -> None:
        """Press the button of a choice in the panel."""
        script = "[...document.querySelectorAll('.choice button')].find(b => b.innerText === arguments[0]).click()"
        self.run(script, words)

    def slide(self, name: str, value: float) -> None:
        script = """
            const input = document.getElementById(arguments[0]);
            input.value = arguments[1];
            input.dispatchEvent(new Event("input", { bubbles: true }));
        """
        self.run(script, name, value)

    def complaints(self) -> list[str]:
        """Return errors and warnings of the console; that WebGL runs without a graphics processor is no fault."""
        told = [entry["message"] for entry in self.driver.get_log("browser")]
        return [line for line in told if "WebGL" not in line and "GL Driver" not in line]

    def requests(self) -> set[str]:
        """Return the addresses that were asked for, without what lies in the page itself."""
        asked = set()
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                asked.add(message["params"]["request"]["url"])
        return {address for address in asked if not address.startswith(("data:", "blob:"))}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    if not (BROWSER and DRIVER):
        pytest.skip("no Chromium with its driver here: apt-get install chromium chromium-driver")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium drives the browser: pip install selenium")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for switch in (*SWITCHES, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(WAIT_S)
    yield Page(driver)
    driver.quit()


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
    assert result.text("reading-seen") == "both"
    assert result.run("return getComputedStyle(document.getElementById('needle')).opacity") == "1"
    result.mouse("mouseMoved", 1, 40)
    result.until(lambda: result.text("reading-seen") == "one")


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
    for expected in ("Figures", "Seen by both cameras", "mesh.glb", "bdffnet-r16-v1", "write results"):
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
