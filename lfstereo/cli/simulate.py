"""``lfstereo simulate``: a dual-Illum capture of a scene with known depth."""

from __future__ import annotations

import argparse
import json
from contextlib import nullcontext
from pathlib import Path

from lfstereo.options import add_arguments, from_arguments, read_toml
from lfstereo.outputs import check_absent
from lfstereo.progress import progress_bar, silent
from lfstereo.simulate.options import SimulateOptions


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the captures and the truth")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--force", action="store_true", help="replace an output folder that exists")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    add_arguments(parser, SimulateOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    table = read_toml(arguments.config).get("simulate", {}) if arguments.config else {}
    options = from_arguments(SimulateOptions, arguments, table, f"{arguments.config} [simulate]")
    check_absent(arguments.output, arguments.force)
    from lfstereo.simulate.folder import write_simulation

    with nullcontext(silent) if arguments.json else progress_bar("simulate") as progress:
        rig = write_simulation(arguments.output, options, arguments.force, progress)
    width, height = rig.left.sensor_px
    summary = {
        "output": str(arguments.output),
        "sensor_px": [width, height],
        "serials": [rig.left.serial, rig.right.serial],
        "boards": options.boards,
    }
    if arguments.json:
        print(json.dumps(summary))
    else:
        print(f"{arguments.output}: two captures of {width} x {height} px, white images, rig.toml, truth", end="")
        print(f", {options.boards} board shots" if options.boards else "")
    return 0
