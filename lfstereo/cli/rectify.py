"""``lfstereo rectify``: one camera's light field rectified as the Light Field Toolbox does."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("input", type=Path, help="light field (.h5, .mat), decoded as for the calibration")
    parser.add_argument(
        "--calibration", type=Path, required=True, help="the toolbox's CalInfo.json, with intrinsics and distortion"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="light field to write (.h5, .mat)")
    parser.add_argument("--force", action="store_true", help="replace an output that exists")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_absent(arguments.output, arguments.force)
    from lfstereo.lightfield.interchange.formats import choose_format, export_light_field
    from lfstereo.lightfield.store import read_light_field
    from lfstereo.rig.lftoolbox import rectify_as_lftoolbox
    from lfstereo.rig.lftoolbox_file import read_calibration

    name = choose_format(arguments.output, None)
    measured = read_calibration(arguments.calibration)
    clock = StageClock(bars=sys.stderr.isatty())
    with clock.stage("read"):
        light_field = read_light_field(arguments.input)
    with clock.stage("rectify") as progress:
        rectified = rectify_as_lftoolbox(light_field, measured, progress=progress)
    with clock.stage("write") as progress:
        export_light_field(arguments.output, rectified, name, arguments.force, progress)
    print(f"written: {arguments.output}")
    return 0
