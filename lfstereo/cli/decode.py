"""``lfstereo decode``: a raw capture to a light field."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from lfstereo.develop.options import DevelopOptions
from lfstereo.lenslet.options import GridOptions
from lfstereo.lightfield.options import DecodeMethod, DecodeOptions, ViewOptions
from lfstereo.options import OptionsT, add_arguments, from_arguments, from_mapping, read_toml
from lfstereo.outputs import atomic_file, check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.container.capture import Capture
    from lfstereo.lightfield.calibration import LensletCalibration
    from lfstereo.lightfield.field import LightField


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "capture", type=Path, help="LFR, LFP, RAW or DNG capture, or with --camera an image of its mosaic"
    )
    parser.add_argument(
        "--whites", type=Path, help="folder or archive of white images, or one (default: those imported)"
    )
    parser.add_argument("--camera", help="camera of a mosaic stored as an image: lytro-f01 or lytro-illum")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="light field to write (.h5, or .mat for MATLAB)"
    )
    parser.add_argument("--preview", type=Path, help="picture of the views and the grid (default: beside the output)")
    parser.add_argument("--report", action="store_true", help="add a map of what the grid leaves to that picture")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--keep-serials", action="store_true", help="write camera serial numbers, not only their marks")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    methods = get_args(DecodeMethod)
    parser.add_argument(
        "--method", choices=methods, help="how views are read (default: direct); lftoolbox gives MATLAB's numbers"
    )
    for options in (ViewOptions, GridOptions, DevelopOptions):
        add_arguments(parser, options)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    preview = arguments.preview or arguments.output.with_suffix(".png")
    check_absent(arguments.output, arguments.force)
    check_absent(preview, arguments.force)
    options = _options(arguments)

    from lfstereo.container.serials import camera_mark
    from lfstereo.lightfield.calibration import calibrate_photograph, decode_with
    from lfstereo.lightfield.interchange.formats import export_light_field
    from lfstereo.lightfield.interchange.lftoolbox_mat import SUFFIX as MAT_SUFFIX
    from lfstereo.lightfield.store import check_suffix

    if arguments.output.suffix.lower() != MAT_SUFFIX:
        check_suffix(arguments.output)
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    with clock.stage("read"):
        capture = _read(arguments)
    with clock.stage("lenslet grid") as progress:
        found = calibrate_photograph(capture, arguments.whites, options.grid, progress)
    with clock.stage("views") as progress:
        light_field = decode_with(capture, found, options, progress)
    with clock.stage("write"):
        if not arguments.keep_serials:
            light_field = replace(light_field, serial=camera_mark(light_field.serial))
        export_light_field(arguments.output, light_field, force=arguments.force)
        _write_preview(preview, light_field, capture, found, arguments)
    summary = _summary(light_field, found, clock)
    print(json.dumps(summary, indent=2) if arguments.json else _text(summary, arguments.output, preview))
    return 0


def _options(arguments: argparse.Namespace) -> DecodeOptions:
    tables = read_toml(arguments.config) if arguments.config else {}

    def given(options: type[OptionsT], name: str) -> OptionsT:
        return from_arguments(options, arguments, tables.get(name, {}), f"{arguments.config} [{name}]")

    in_file = tables.get("decode", {}).pop("method", "direct")
    named = from_mapping(DecodeOptions, {"method": arguments.method or in_file}, f"{arguments.config} [decode]")
    return replace(
        named,
        view=given(ViewOptions, "decode"),
        grid=given(GridOptions, "grid"),
        develop=given(DevelopOptions, "develop"),
    )


def _read(arguments: argparse.Namespace) -> Capture:
    from lfstereo.container.capture import read_capture
    from lfstereo.container.mosaic_image import read_mosaic_image

    if arguments.camera:
        return read_mosaic_image(arguments.capture, arguments.camera)
    return read_capture(arguments.capture)


def _write_preview(
    path: Path, light_field: LightField, capture: Capture, found: LensletCalibration, arguments: argparse.Namespace
) -> None:
    import cv2
    import numpy as np

    from lfstereo.lenslet.overlay import draw_grid
    from lfstereo.lenslet.residual import draw_residual, measure_residual
    from lfstereo.lightfield.field import in_srgb
    from lfstereo.lightfield.views import montage

    framed, grid = (capture, found.grid) if found.white is None else (found.white, found.white_grid or found.grid)
    below = draw_grid(framed, grid)
    if arguments.report:
        residual = draw_residual(measure_residual(framed, grid), grid, below.shape[1])
        below = np.concatenate([below, residual], axis=0)
    encoded = cv2.imencode(".png", montage(in_srgb(light_field), below)[..., ::-1])[1]
    with atomic_file(path, arguments.force) as scratch:
        scratch.write_bytes(encoded.tobytes())


def _summary(light_field: LightField, found: LensletCalibration, clock: StageClock) -> dict[str, Any]:
    grid = found.grid
    return {
        "views": list(light_field.views.shape),
        "grid_from": grid.source,
        "lenslets": [grid.rows, grid.columns],
        "pitch_px": (grid.step_u_px[0] ** 2 + grid.step_u_px[1] ** 2) ** 0.5,
        "grid_residual_px": grid.residual_px,
        "grid_quality": grid.quality,
        "grid_uncertainty_px": grid.uncertainty_px,
        "grid_offset_px": found.offset_px,
        "white_image": found.white.source if found.white else None,
        "hot_pixels": 0 if found.hot_pixels is None else len(found.hot_pixels),
        "seconds": clock.seconds,
        "peak_memory_gib": max(clock.peak_gib.values()),
    }


def _text(summary: dict[str, Any], output: Path, preview: Path) -> str:
    rows, columns = summary["lenslets"]
    off_px = summary["grid_offset_px"]
    offset = "" if off_px is None else f", {off_px:.3f} px off the capture's own micro-images"
    times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items())
    return "\n".join(
        [
            "views {} x {} of {} x {} px".format(*(summary["views"][k] for k in (0, 1, 3, 2))),
            f"grid from the {summary['grid_from']}: {rows} x {columns} lenslets, pitch {summary['pitch_px']:.4f} px, "
            f"residual {summary['grid_residual_px']:.3f} px, {summary['grid_quality']:.1%} agree" + offset,
            f"{times}; peak memory {summary['peak_memory_gib']:.2f} GiB",
            f"light field: {output} (look first at {preview})",
        ]
    )
