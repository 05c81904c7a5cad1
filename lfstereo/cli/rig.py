"""``lfstereo rig``: a rig to and from the files of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.rig.interchange import PlenopticPart

    parser.add_argument("input", type=Path, help="rig file (.toml), or OpenCV YAML with M1, D1, M2, D2, R, T")
    parser.add_argument("-o", "--output", type=Path, required=True, help="file to write")
    parser.add_argument(
        "--format",
        choices=("toml", "opencv", "kalibr", "json"),
        help="toml: lfstereo's own; opencv: YAML; kalibr: camchain YAML; json (default: by the output's suffix). "
        "OpenCV and Kalibr keep the centre views alone, without focus distance and distance of the views",
    )
    parser.add_argument("--force", action="store_true", help="replace an output that exists")
    add_arguments(parser, PlenopticPart)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.rig.interchange import PlenopticPart, choose_format, export_rig, import_rig

    check_absent(arguments.output, arguments.force)
    name = choose_format(arguments.output, arguments.format)
    rig = import_rig(arguments.input, from_arguments(PlenopticPart, arguments))
    export_rig(arguments.output, rig, name, arguments.force)
    print(f"{arguments.output}: {name}, baseline {rig.baseline_m * 1e3:.3f} mm", end="")
    print(", centre views only" if name in ("opencv", "kalibr") else "")
    return 0
