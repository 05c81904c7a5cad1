"""Time from asking ``lfstereo view``'s server for a refocused picture to its JPEG, beside exact refocusing.

Run: ``python benchmarks/bench_live_view.py``. Both are timed in the same run, so the ratio holds on a busy machine too.
"""

from __future__ import annotations

import http.client
import statistics
import tempfile
import threading
import time
from pathlib import Path

import cv2
import numpy as np

from lfstereo.focus.aperture import RefocusOptions
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.store import write_light_field
from lfstereo.viewer.server import PageServer
from lfstereo.viewer.shelf import find_items

VIEWS = (15, 15, 434, 625)
FRAMES = 20
WISHES = {
    "full aperture": (7.5, (0.0, 0.0)),
    "half aperture": (3.75, (0.0, 0.0)),
    "tilted plane": (7.5, (0.2, 0.1)),
}


def textured_field() -> LightField:
    """Return a full-size light field of a flat, textured scene."""
    noise = np.random.default_rng(0).random((*VIEWS[2:], 3), dtype=np.float32)
    scene = cv2.GaussianBlur(noise, None, 1.2)
    views = np.broadcast_to(scene, (*VIEWS, 3)).copy()
    return LightField(views, None, None, "", "benchmark")


def live_ms(server: PageServer, radius: float, tilt: tuple[float, float]) -> list[float]:
    """Return the time of each frame as a browser on this computer waits for it, ms."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port)
    times = []
    for slope in np.linspace(-0.3, 0.3, FRAMES + 1):
        query = f"slope={slope:.4f}&radius={radius}&tilt_x={tilt[0]}&tilt_y={tilt[1]}"
        started = time.perf_counter()
        connection.request("GET", f"/{server.token}/item/0/refocus?{query}")
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 200
        times.append(1e3 * (time.perf_counter() - started))
    return times[1:]


def exact_ms(field: LightField, radius: float, tilt: tuple[float, float]) -> float:
    """Return the time of one exact picture, without its JPEG, ms."""
    options = RefocusOptions(radius_views=radius, tilt=tilt)
    refocus(field, [0.1], options)  # compiles, or loads what was compiled
    started = time.perf_counter()
    refocus(field, [0.12], options)
    return 1e3 * (time.perf_counter() - started)


def main() -> None:
    """Print the median and the largest time of a frame, and the ratio to exact refocusing."""
    field = textured_field()
    print(f"one picture from {VIEWS[0]} x {VIEWS[1]} views of {VIEWS[2]} x {VIEWS[3]} px")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "field.h5"
        write_light_field(path, field)
        with PageServer(find_items(path)) as server:
            started = time.perf_counter()
            server.opened(0)
            print(f"opened in {time.perf_counter() - started:.1f} s")
            threading.Thread(target=server.serve_forever, daemon=True).start()
            for name, (radius, tilt) in WISHES.items():
                times, exact = live_ms(server, radius, tilt), exact_ms(field, radius, tilt)
                median = statistics.median(times)
                print(
                    f"{name:<15} live {median:5.0f} ms, slowest {max(times):5.0f} ms; exact {exact:6.0f} ms, "
                    f"{exact / median:.1f} times as long"
                )
            server.shutdown()


if __name__ == "__main__":
    main()
