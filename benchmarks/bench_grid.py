"""Fit the lenslet grid of simulated full-size white images and measure it against the simulated lattice.

Run ``python benchmarks/bench_grid.py``. Beside this project's fit stands the Light Field Toolbox's method, written from
its description. "whole" are round micro-images that nothing cuts; "cut" those of a lens at f/2 and 20 mm, whose barrel
cuts the micro-images towards the corners (cat's eye), so that their brightness lies off their lenslets' centres.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from grid_of_lftoolbox import fit_grid_as_lftoolbox

from lfstereo.arrays import Float64
from lfstereo.container import Capture
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.capture import take_white_image
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig

STRIP_ROWS = 128
BORDER_FIELD = 0.8


def true_lattice(camera: SimulatedCamera) -> Lattice:
    """Return the lattice that a simulated camera's micro-images lie on."""
    origin, along, down = (np.asarray(part, np.float64) for part in camera.lattice())
    return Lattice(origin, along, down + 0.5 * along)


def distances_px(fitted: Lattice, true: Lattice, shape: tuple[int, int]) -> tuple[Float64, Float64]:
    """Return how far the fitted lattice lies from each true centre, px, and the field of each, 1 = the corners."""
    centres = true.origin + true.indices_inside(shape, 0.5 * true.pitch) @ true.matrix.T
    index = (centres - fitted.origin) @ fitted.reciprocal.T
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    field = np.hypot(*(centres - middle).T) / np.hypot(*middle)
    return np.asarray(np.hypot(*((index - np.round(index)) @ fitted.matrix.T).T), np.float64), field


def draw_whole(white: Capture, lattice: Lattice) -> Capture:
    """Draw round micro-images on a lattice, with the Bayer responses and the noise of a real Illum."""
    height, width = white.mosaic.shape
    rng = np.random.default_rng(1)
    mosaic = np.empty((height, width), np.uint16)
    x = np.arange(width)
    for top in range(0, height, STRIP_ROWS):
        y = np.arange(top, min(top + STRIP_ROWS, height))[:, None]
        i, j = (
            lattice.reciprocal[k, 0] * (x - lattice.origin[0]) + lattice.reciprocal[k, 1] * (y - lattice.origin[1])
            for k in (0, 1)
        )
        i, j = i - np.floor(i), j - np.floor(j)
        radius = np.min(
            [np.hypot(*np.tensordot(lattice.matrix, (i - a, j - b), 1)) for a in (0, 1) for b in (0, 1)], axis=0
        )
        light = 1 / (1 + np.exp((radius - 0.46 * lattice.pitch) / 0.3)) * (1 - 0.1 * (2 * radius / lattice.pitch) ** 2)
        r, gr, gb, b = white.metadata.normalized_responses
        site = np.where(y % 2 == 0, np.where(x % 2 == 0, gr, r), np.where(x % 2 == 0, b, gb))
        mosaic[y[:, 0]] = np.round(64 + 700 * light * site + rng.normal(0, 1, light.shape))
    return replace(white, mosaic=mosaic, source="drawn white image")


def report(name: str, fitted: Lattice, true: Lattice, shape: tuple[int, int], seconds: tuple[float, float]) -> None:
    """Print one row of the table."""
    off, field = distances_px(fitted, true, shape)
    border = off[field > BORDER_FIELD]
    pitch = float(np.hypot(*fitted.row) - np.hypot(*true.row))
    print(
        f"{name:<28}{np.sqrt(np.mean(off**2)):>9.4f}{off.max():>9.4f}{np.sqrt(np.mean(border**2)):>11.4f}"
        f"{pitch:>16.1e}{seconds[0]:>8.1f}{seconds[1]:>8.1f}",
        flush=True,
    )


def main() -> None:
    """Print a row for each method, camera and kind of micro-image."""
    options = SimulateOptions()
    rig = build_rig(options)
    print(f"{'':<28}{'rms px':>9}{'max px':>9}{'border px':>11}{'pitch error px':>16}{'CPU s':>8}{'wall s':>8}")
    for side in ("left", "right"):
        true = true_lattice(rig.left if side == "left" else rig.right)
        cut = take_white_image(rig, side, options)
        for kind, white in (("cut", cut), ("whole", draw_whole(cut, true))):
            shape = white.mosaic.shape[0], white.mosaic.shape[1]
            wall, cpu = time.perf_counter(), time.process_time()
            grid = fit_grid(white)
            seconds = time.process_time() - cpu, time.perf_counter() - wall
            report(f"{side}, {kind}", Lattice.of(grid), true, shape, seconds)
            wall, cpu = time.perf_counter(), time.process_time()
            pitch_px = white.metadata.lenslets.pitch_m / white.metadata.pixel_pitch_m
            theirs = fit_grid_as_lftoolbox(white.mosaic, pitch_px)
            seconds = time.process_time() - cpu, time.perf_counter() - wall
            report(f"{side}, {kind}, toolbox's way", theirs, true, shape, seconds)


if __name__ == "__main__":
    main()
