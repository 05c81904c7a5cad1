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
    from lfstereo.lenslet.grid import LensletGrid
    from lfstereo.lightfield.field import LightField


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("capture", type=Path, help="LFR, LFP, RAW or DNG capture, or with --camera an image of its mosaic")
    parser.add_argument("--whites", type=Path, help="folder with the camera's white images, or one white image")
    parser.add_argument("--camera", help="camera of a mosaic stored as an image: lytro-f01 or lytro-illum")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="light field to write (.h5, or .mat for MATLAB)"
    )
    parser.add_argument("--preview", type=Path, help="picture of the views and the grid (default: beside the output)")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
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

    from lfstereo.lightfield.decoding import calibrate, check_method, views_from
    from lfstereo.lightfield.interchange.formats import export_light_field
    from lfstereo.lightfield.interchange.lftoolbox_mat import SUFFIX as MAT_SUFFIX
    from lfstereo.lightfield.lftoolbox import decode_as_lftoolbox
    from lfstereo.lightfield.store import check_suffix

    if arguments.output.suffix.lower() != MAT_SUFFIX:
        check_suffix(arguments.output)
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    with clock.stage("read"):
        capture, white = _read(arguments)
    check_method(options, white)
    with clock.stage("lenslet grid") as progress:
        grid, shading = calibrate(capture, white, options.grid, progress)
    with clock.stage("views") as progress:
        if options.method == "lftoolbox" and white is not None:
            light_field = decode_as_lftoolbox(capture, white, grid, progress)
        else:
            light_field = views_from(capture, grid, shading, options, progress)
    with clock.stage("write"):
        export_light_field(arguments.output, light_field, force=arguments.force)
        _write_preview(preview, light_field, white or capture, grid, arguments.force)
    summary = _summary(light_field, grid, clock)
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


def _read(arguments: argparse.Namespace) -> tuple[Capture, Capture | None]:
    from lfstereo.container.capture import read_capture
    from lfstereo.container.mosaic_image import read_mosaic_image
    from lfstereo.lenslet.white import find_white_image

    if arguments.camera:
        capture = read_mosaic_image(arguments.capture, arguments.camera)
    else:
        capture = read_capture(arguments.capture)
    if arguments.whites is None:
        print("no --whites given: lenslet grid and vignetting are estimated from the photograph", file=sys.stderr)
        return capture, None
    return capture, find_white_image(arguments.whites, capture.metadata)


def _write_preview(path: Path, light_field: LightField, framed: Capture, grid: LensletGrid, force: bool) -> None:
    import cv2

    from lfstereo.lenslet.overlay import draw_grid
    from lfstereo.lightfield.field import in_srgb
    from lfstereo.lightfield.views import montage

    picture = montage(in_srgb(light_field), draw_grid(framed, grid))
    encoded = cv2.imencode(".png", picture[..., ::-1])[1]
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(encoded.tobytes())


def _summary(light_field: LightField, grid: LensletGrid, clock: StageClock) -> dict[str, Any]:
    return {
        "views": list(light_field.views.shape),
        "grid_from": grid.source,
        "lenslets": [grid.rows, grid.columns],
        "pitch_px": (grid.step_u_px[0] ** 2 + grid.step_u_px[1] ** 2) ** 0.5,
        "grid_residual_px": grid.residual_px,
        "grid_quality": grid.quality,
        "seconds": clock.seconds,
        "peak_memory_gib": max(clock.peak_gib.values()),
    }


def _text(summary: dict[str, Any], output: Path, preview: Path) -> str:
    rows, columns = summary["lenslets"]
    times = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items())
    return "\n".join(
        [
            "views {} x {} of {} x {} px".format(*(summary["views"][k] for k in (0, 1, 3, 2))),
            f"grid from the {summary['grid_from']}: {rows} x {columns} lenslets, pitch {summary['pitch_px']:.4f} px, "
            f"residual {summary['grid_residual_px']:.3f} px, {summary['grid_quality']:.1%} agree",
            f"{times}; peak memory {summary['peak_memory_gib']:.2f} GiB",
            f"light field: {output} (look first at {preview})",
        ]
    )
