"""``lfstereo filter``: a light field with only what lies at one depth, or in a range of depths."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.focus.filters import FilterOptions

    parser.add_argument("input", type=Path, help="light field (.h5, .mat, ESLF .png, folder of views)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="light field to write (.h5), or its centre view (.png)"
    )
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    add_arguments(parser, FilterOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.focus.filters import FilterOptions, filter_light_field

    target = arguments.output
    check_absent(target, arguments.force)
    if target.suffix.lower() not in (".h5", ".hdf5", ".png"):
        raise ConfigError(f"{target}: found the suffix '{target.suffix}', expected .h5 or .png; rename the output")
    options = from_arguments(FilterOptions, arguments)

    from lfstereo.depth.pictures import write_png
    from lfstereo.lightfield.encoding import srgb16
    from lfstereo.lightfield.store import read_light_field, write_light_field

    clock = StageClock(bars=sys.stderr.isatty())
    with clock.stage("read"):
        light_field = read_light_field(arguments.input)
    with clock.stage("filter") as progress:
        filtered = filter_light_field(light_field, options, progress)
    with clock.stage("write"):
        if target.suffix.lower() == ".png":
            write_png(target, srgb16(filtered.views[filtered.centre]), arguments.force)
        else:
            write_light_field(target, filtered, arguments.force)
    print(f"written: {target}")
    return 0
