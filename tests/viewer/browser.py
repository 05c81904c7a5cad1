"""A browser without a window, and what a hand can do with a page in it."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
WAIT_S = 240.0
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

    def __init__(self, driver: Any, columns: int) -> None:
        self.driver = driver
        self.columns = columns
        """Of the pictures on a result's page."""

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
        scale = box[2] / self.columns
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


def browsed(profile: Path, columns: int) -> Iterator[Page]:
    """Start a browser and end it; skips the test where there is none."""
    if not (BROWSER and DRIVER):
        pytest.skip("no Chromium with its driver here: apt-get install chromium chromium-driver")
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium drives the browser: pip install selenium")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for switch in (*SWITCHES, f"--user-data-dir={profile}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(WAIT_S)
    yield Page(driver, columns)
    driver.quit()
