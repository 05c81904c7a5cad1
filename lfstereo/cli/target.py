"""``lfstereo target``: a calibration board to print, and its TOML file."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.rig.target import Target

    parser.add_argument("-o", "--output", type=Path, required=True, help="board to print: .svg or .pdf")
    parser.add_argument("--force", action="store_true", help="replace outputs that exist")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    add_arguments(parser, Target)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.rig.target import Target, write_target
    from lfstereo.rig.target_print import check_print_suffix, print_target

    target = from_arguments(Target, arguments)
    described = arguments.output.with_suffix(".toml")
    check_print_suffix(arguments.output)
    check_absent(described, arguments.force)
    sheet = print_target(arguments.output, target, arguments.force)
    write_target(described, target, arguments.force)
    summary = {
        "print": str(arguments.output),
        "target": str(described),
        "page_mm": [sheet.width_mm, sheet.height_mm],
    }
    if arguments.json:
        print(json.dumps(summary))
    else:
        print(f"{arguments.output}: {sheet.width_mm:g} x {sheet.height_mm:g} mm, print at 100 % and check the ruler")
        print(f"{described}: give this file to 'lfstereo calibrate --target'")
    return 0
