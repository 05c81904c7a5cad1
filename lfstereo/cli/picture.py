"""``lfstereo picture``: one picture of a light field: a perspective, an epipolar-plane image, a quilt."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.arrays import UInt8
    from lfstereo.lightfield.field import LightField
    from lfstereo.progress import Progress


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.lightfield.perspective import QuiltOptions

    parser.add_argument("input", type=Path, help="light field (.h5, .mat, ESLF .png, folder of views)")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        help="picture to write (.png); a quilt's tiles are added to its name",
    )
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--row", type=int, help="epipolar-plane image of this image row through the centre row of views")
    what.add_argument("--column", type=int, help="likewise of this image column through the centre column of views")
    what.add_argument(
        "--quilt", action="store_true", help="many perspectives from left to right, for a holographic display"
    )
    parser.add_argument(
        "--position",
        type=float,
        nargs=2,
        default=(0.0, 0.0),
        metavar=("X", "Y"),
        help="where to see from, in views "
        "from the centre view, also between views; with --row and --column, the row or column of views (default: 0 0)",
    )
    parser.add_argument(
        "--zoom", type=int, default=1, help="times each view's line is repeated in an epipolar-plane image"
    )
    add_arguments(parser.add_argument_group("quilt"), QuiltOptions)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.lightfield.perspective import QuiltOptions, quilt_name

    target = arguments.output
    if target.suffix.lower() != ".png":
        raise ConfigError(f"{target}: found the suffix '{target.suffix}', expected .png; rename the output")
    if arguments.zoom < 1:
        raise ConfigError(f"--zoom: found {arguments.zoom}, expected 1 or more")
    options = from_arguments(QuiltOptions, arguments)
    if not arguments.quilt:
        check_absent(target, arguments.force)

    from lfstereo.depth.pictures import write_png
    from lfstereo.lightfield.store import read_light_field

    clock = StageClock(bars=sys.stderr.isatty())
    with clock.stage("read"):
        light_field = read_light_field(arguments.input)
    if arguments.quilt:
        target = target.with_name(quilt_name(target.stem, light_field, options))
        check_absent(target, arguments.force)
    with clock.stage("picture") as progress:
        write_png(target, _draw(light_field, arguments, options, progress), arguments.force)
    print(f"written: {target}")
    return 0


def _draw(light_field: LightField, arguments: argparse.Namespace, options: object, progress: Progress) -> UInt8:
    import numpy as np

    from lfstereo.lightfield.encoding import srgb8
    from lfstereo.lightfield.perspective import QuiltOptions, perspective_view, quilt
    from lfstereo.lightfield.views import horizontal_epi, vertical_epi

    assert isinstance(options, QuiltOptions)
    if arguments.quilt:
        return quilt(light_field, options, progress)
    right, down = arguments.position
    t0, s0 = light_field.centre
    if arguments.row is not None:
        epi = horizontal_epi(light_field, arguments.row, t0 + round(down))
        return np.repeat(srgb8(epi), arguments.zoom, axis=0)
    if arguments.column is not None:
        epi = vertical_epi(light_field, arguments.column, s0 + round(right))
        return np.repeat(srgb8(epi), arguments.zoom, axis=0)
    return srgb8(perspective_view(light_field, (right, down), options.slope))
