"""``lfstereo view-grid``: a picture that shows whether a lenslet grid fits."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfstereo.lenslet.options import GridOptions
from lfstereo.options import add_arguments, from_arguments, read_toml
from lfstereo.outputs import atomic_file, check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.lenslet.grid import LensletGrid
    from lfstereo.lenslet.residual import GridResidual


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("capture", type=Path, help="white image, or a photograph (LFR, LFP, RAW)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="picture to write (.png)")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON on stdout")
    add_arguments(parser, GridOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_absent(arguments.output, arguments.force)
    table = read_toml(arguments.config).get("grid", {}) if arguments.config else {}
    options = from_arguments(GridOptions, arguments, table, f"{arguments.config} [grid]")

    import cv2
    import numpy as np

    from lfstereo.container.capture import read_capture
    from lfstereo.lenslet.fit import estimate_grid_from_photograph, fit_grid
    from lfstereo.lenslet.overlay import draw_grid
    from lfstereo.lenslet.residual import draw_residual, measure_residual

    clock = StageClock(bars=sys.stderr.isatty())
    with clock.stage("read"):
        capture = read_capture(arguments.capture)
    with clock.stage("lenslet grid") as progress:
        fit = fit_grid if capture.metadata.is_white_image else estimate_grid_from_photograph
        grid = fit(capture, options, progress)
    with clock.stage("residual"):
        residual = measure_residual(capture, grid, options)
        crops = draw_grid(capture, grid)
        picture = np.concatenate([crops, draw_residual(residual, grid, crops.shape[1])], axis=0)
        encoded = cv2.imencode(".png", picture[..., ::-1])[1]
    with atomic_file(arguments.output, arguments.force) as scratch:
        scratch.write_bytes(encoded.tobytes())
    summary = _summary(grid, residual)
    print(json.dumps(summary, indent=2) if arguments.json else _text(summary, arguments.output))
    return 0


def _summary(grid: LensletGrid, residual: GridResidual) -> dict[str, Any]:
    (ux, uy), (vx, vy) = grid.step_u_px, grid.step_v_px
    return {
        "grid_from": grid.source,
        "lenslets": [grid.rows, grid.columns],
        "pitch_px": math.hypot(ux, uy),
        "row_distance_px": (ux * vy - uy * vx) / math.hypot(ux, uy),
        "rotation_rad": math.atan2(uy, ux),
        "shear_rad": (ux * vx + uy * vy) / (math.hypot(ux, uy) * math.hypot(vx, vy)),
        "origin_px": list(grid.origin_px),
        "grid_residual_px": grid.residual_px,
        "grid_quality": grid.quality,
        "rms_px": residual.rms_px(),
        "rms_middle_px": residual.rms_px(0, 0.45),
        "rms_border_px": residual.rms_px(0.8, 1),
        "lenslets_measured": len(residual.found),
        "share_found": float(residual.found.mean()),
    }


def _text(summary: dict[str, Any], output: Path) -> str:
    rows, columns = summary["lenslets"]
    return "\n".join(
        [
            f"grid from the {summary['grid_from']}: {rows} x {columns} lenslets, pitch {summary['pitch_px']:.4f} px, "
            f"rows {summary['row_distance_px']:.4f} px apart, turned by {1e3 * summary['rotation_rad']:.3f} mrad",
            f"robust residual {summary['grid_residual_px']:.4f} px, {summary['grid_quality']:.1%} of all agree",
            f"RMS of {summary['lenslets_measured']} centres: {summary['rms_px']:.4f} px, in the middle "
            f"{summary['rms_middle_px']:.4f} px, at the border {summary['rms_border_px']:.4f} px",
            f"picture: {output}",
        ]
    )
