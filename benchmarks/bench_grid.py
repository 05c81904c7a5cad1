"""Fit the lenslet grid of a simulated full-size white image and measure it against the simulated lattice.

Run ``python benchmarks/bench_grid.py``. On a frame of this size the Light Field Toolbox v0.5.3 reaches 0.015 px rms,
PlenoptiCam's best mode 0.0019 px.
"""

from __future__ import annotations

import time
from typing import Literal

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.capture import take_white_image
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import build_rig


def distances_px(grid: LensletGrid, camera: SimulatedCamera) -> Float64:
    """Return how far each fitted centre lies from the true one beside it, px."""
    origin, along, down = camera.lattice()
    centres = grid.centres().reshape(-1, 2)
    columns, rows = np.linalg.solve(np.column_stack([along, down]), (centres - origin).T)
    row = np.round(rows)
    column = np.round(columns - (row % 2) / 2)
    true = origin + (column + (row % 2) / 2)[:, None] * along + row[:, None] * down
    distances: Float64 = np.hypot(*(centres - true).T)
    return distances


def main() -> None:
    """Print one row per camera of the default rig."""
    options = SimulateOptions()
    rig = build_rig(options)
    sides: tuple[tuple[Literal["left", "right"], SimulatedCamera], ...] = (("left", rig.left), ("right", rig.right))
    print(f"{'camera':<10}{'rms px':>10}{'max px':>10}{'pitch error px':>16}{'CPU s':>8}{'wall s':>8}")
    for side, camera in sides:
        white = take_white_image(rig, side, options)
        wall, cpu = time.perf_counter(), time.process_time()
        grid = fit_grid(white)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        off = distances_px(grid, camera)
        pitch = float(np.hypot(*grid.step_u_px) - np.hypot(*camera.lattice()[1]))
        rms = float(np.sqrt(np.mean(off**2)))
        print(f"{side:<10}{rms:>10.4f}{off.max():>10.4f}{pitch:>16.1e}{cpu:>8.1f}{wall:>8.1f}")


if __name__ == "__main__":
    main()
