"""How true decoded views are, and how long the decode takes.

Run ``python benchmarks/bench_decode.py quality`` or ``python benchmarks/bench_decode.py speed``.

``quality`` draws raw frames of textures at known slopes and prints the PSNR (dB, 1.0 = white) of all views by their
distance from the centre view, beside the Light Field Toolbox's decode of the same frames, plain and with the
white-image guided demosaic of David et al. One gain per colour is fitted to the centre view of each method.

``speed`` decodes a simulated full-size frame and prints for each stage its seconds, the bytes it reads and writes,
and its wall time beside that of a plain copy of as many bytes.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from known_light_field import KnownFrame, Waves, draw

from lfstereo.container import read_capture, write_capture
from lfstereo.develop.demosaic_david import david2017
from lfstereo.develop.develop import develop_mosaic, output_matrix
from lfstereo.develop.options import DevelopOptions
from lfstereo.develop.shading import shading_from_white_image
from lfstereo.lightfield import lftoolbox
from lfstereo.lightfield.decoding import views_from
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.micro_images import MicroImages, micro_image_operators
from lfstereo.lightfield.options import DecodeOptions
from lfstereo.lightfield.resample import offsets_inside, sample_views, view_sampling
from lfstereo.lightfield.store import write_light_field

RINGS = (0.0, 0.1, 3.2, 5.2, 6.3, 7.1)
"""Distances from the centre view, view steps."""
SLOPES = (0.0, 0.25, 0.5, 1.0)
BORDER = 5
TEXTURES = {
    "as the toolbox's reference frame, colours alike": (0.08, 0.18, 0.0, 0.0, 1.0),
    "1/20 of the variance is each colour's own": (0.08, 0.18, 0.05, 0.0, 1.0),
    "colours independent": (0.08, 0.18, 1.0, 0.0, 1.0),
    "coarse to fine": (0.02, 0.4, 0.05, 0.0, 1.0),
    "colours alike, light leaks into the next lenslet": (0.08, 0.18, 0.0, 0.45, 1.0),
    "colours alike, noise of 8 DN": (0.08, 0.18, 0.0, 0.0, 8.0),
}
"""Frequencies (cycles per row of lenslets), share of the variance of each colour's own, leak px, noise DN."""


def as_toolbox(frame: KnownFrame) -> LightField:
    """Decode as the Light Field Toolbox v0.5.3."""
    return lftoolbox.decode_as_lftoolbox(frame.photograph, frame.white, frame.grid)


def as_guided_toolbox(frame: KnownFrame) -> LightField:
    """Decode as its unreleased branch with the white image guided demosaic."""
    shading = shading_from_white_image(frame.white)
    with mock.patch.object(
        lftoolbox, "malvar2004", lambda mosaic, bayer: david2017(mosaic, bayer, shading, frame.grid)
    ):
        return as_toolbox(frame)


def ours(**develop: Any) -> Callable[[KnownFrame], LightField]:
    """Return the decode with some options of the development."""

    def decode(frame: KnownFrame) -> LightField:
        options = DecodeOptions(develop=DevelopOptions(**develop))
        return views_from(frame.photograph, frame.grid, shading_from_white_image(frame.white), options)

    return decode


METHODS: dict[str, Callable[[KnownFrame], LightField]] = {
    "toolbox": as_toolbox,
    "toolbox, guided": as_guided_toolbox,
    "malvar2004": ours(demosaic="malvar2004"),
    "menon2007": ours(demosaic="menon2007"),
    "david2017": ours(demosaic="david2017"),
    "micro-images": ours(),
}


def psnr_by_ring(frame: KnownFrame, light_field: LightField) -> list[float]:
    """Return the PSNR of the centre view and of the rings of views around it."""
    inner = (slice(BORDER, -BORDER), slice(BORDER, -BORDER))
    t0, s0 = light_field.centre
    shown, found = frame.view(light_field, t0, s0)[inner], light_field.views[t0, s0][inner]
    gain = (shown * found).sum((0, 1)) / (found * found).sum((0, 1))
    squares: list[list[float]] = [[] for _ in RINGS[1:]]
    for t, s in np.ndindex(*light_field.views.shape[:2]):
        ring = int(np.searchsorted(RINGS, np.hypot(t - t0, s - s0), side="right")) - 1
        if ring < len(squares):
            error = light_field.views[t, s][inner] * gain - frame.view(light_field, t, s)[inner]
            squares[ring].append(float(np.mean(error**2)))
    return [-10 * float(np.log10(np.mean(ring))) for ring in squares]


def quality() -> None:
    """Print a table per texture and slope, and what our default gains on the better of the toolbox's two."""
    print("PSNR dB: centre view, and views up to 3.2, 5.2, 6.3 and 7.1 steps from it")
    for name, (low, high, own, leak, noise) in TEXTURES.items():
        print(f"\n{name}")
        for slope in SLOPES:
            frame = draw(Waves.between(low, high, own, seed=1), slope, leak, noise)
            found = {method: psnr_by_ring(frame, decode(frame)) for method, decode in METHODS.items()}
            for method, values in found.items():
                print(f"  slope {slope:<5g}{method:<18}" + "".join(f"{value:7.1f}" for value in values))
            best = np.maximum(found["toolbox"], found["toolbox, guided"])
            gained = np.asarray(found["micro-images"]) - best
            print(f"  slope {slope:<5g}{'gained':<18}" + "".join(f"{value:+7.1f}" for value in gained))


@dataclass
class Clock:
    """Times stages, and afterwards copies of as many bytes."""

    rows: list[tuple[str, float, float, float]] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, megabytes: float) -> Iterator[None]:
        """Time one stage that reads and writes so many bytes."""
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        self.rows.append((name, time.perf_counter() - wall, time.process_time() - cpu, megabytes))

    def print(self) -> None:
        """Print the stages, the decode as it runs, some stages beside each other, and the ratios to copies."""
        print(f"\n{'stage':<48}{'wall s':>7}{'CPU s':>7}{'MB moved':>9}{'/ copy':>9}")
        for name, wall, cpu, megabytes in self.rows:
            source = np.ones(int(megabytes * 1e6 / 2), np.uint8)
            target = np.ones_like(source)
            copy = time.perf_counter()
            np.copyto(target, source)
            copy = time.perf_counter() - copy
            print(f"{name:<48}{wall:7.2f}{cpu:7.2f}{megabytes:9.0f}{wall / copy:9.0f}")
        walls, cpus = (sum(row[k] for row in [*self.rows[:3], self.rows[-2]]) for k in (1, 2))
        print(f"{'decode: the first three and all at once':<48}{walls:7.2f}{cpus:7.2f}")


def speed() -> None:
    """Time the stages of a full-size decode, compiled code loaded."""
    from lfstereo.lenslet.fit import fit_grid
    from lfstereo.simulate.capture import take_white_image
    from lfstereo.simulate.options import SimulateOptions
    from lfstereo.simulate.rigs import build_rig

    options = SimulateOptions()
    white = take_white_image(build_rig(options), "left", options)
    grid = fit_grid(white)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.LFR"
        write_capture(path, white)
        clocks = [Clock(), Clock()]
        for clock in clocks:
            decode_in_stages(path, grid, Path(folder) / "field.h5", clock)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        for clock in clocks:
            clock.print()
    print(f"peak memory {peak:.2f} GiB")


def decode_in_stages(path: Path, grid: Any, target: Path, clock: Clock) -> None:
    """Decode one frame that serves as its own white image, and print each stage."""
    with clock.stage("read and unpack the photograph", 52 + 83):
        capture = read_capture(path)
    with clock.stage("read and unpack the white image", 52 + 83):
        white = read_capture(path)
    with clock.stage("illumination from the white image", 83 + 166):
        shading = shading_from_white_image(white)
    with clock.stage("levels, devignetting, hot pixels, white, clips", 83 + 2 * 166 + 166):
        mosaic = develop_mosaic(capture, shading)
    sampling = view_sampling(grid, DecodeOptions().view.view_step_px)
    offsets = offsets_inside(grid, sampling, 15)
    with clock.stage("operators", 256 * 157 * len(offsets) * 3 * 4 / 1e6):
        operators = micro_image_operators(grid, offsets, capture.metadata.bayer, output_matrix(capture.metadata))
    read = MicroImages(mosaic, shading, grid.centres(), operators)
    with clock.stage("views and weights", 2 * 166 + 15 * 15 * 434 * 625 * 13 / 1e6):
        views, weight = sample_views(read, shading, grid, sampling, 15)
    del mosaic, read, views, weight, operators
    with clock.stage("all of the development and the views at once", 83 + 166 + 15 * 15 * 434 * 625 * 13 / 1e6):
        light_field = views_from(capture, grid, shading)
    with clock.stage("write HDF5", 15 * 15 * 434 * 625 * (13 + 7) / 1e6):
        write_light_field(target, light_field, force=True)


if __name__ == "__main__":
    {"quality": quality, "speed": speed}[sys.argv[1] if len(sys.argv) > 1 else "quality"]()
