"""``lfstereo run``: two captures to disparity, depth, all-in-focus image and point cloud."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from lfstereo.options import add_arguments, from_arguments, read_toml
from lfstereo.outputs import check_absent
from lfstereo.pipeline import RunOptions, run_pair
from lfstereo.progress import StageClock
from lfstereo.results import Inputs, Report, read_truth, write_results
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import read_rig
from lfstereo.viewer.content import PAGE_NAME


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("left", type=Path, help="left capture: LFR/LFP/RAW, .h5 light field or folder of views")
    parser.add_argument("right", type=Path, help="right capture, likewise")
    parser.add_argument("--rig", type=Path, required=True, help="rig file of the two cameras")
    parser.add_argument("--whites", type=Path, help="folder or archive of white images (default: those imported)")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the results")
    parser.add_argument("--truth", type=Path, help="folder with a true disparity.pfm to report the error against")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--force", action="store_true", help="replace an output folder that exists")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    add_arguments(parser, RunOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_absent(arguments.output, arguments.force)
    table = read_toml(arguments.config).get("run", {}) if arguments.config else {}
    options = from_arguments(RunOptions, arguments, table, f"{arguments.config} [run]")
    rig = read_rig(arguments.rig)
    inputs = Inputs(arguments.left, arguments.right, arguments.rig)
    truth = read_truth(arguments.truth, rectified_geometry(rig).size) if arguments.truth else None
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    result = run_pair(arguments.left, arguments.right, rig, arguments.whites, options, clock)
    report = write_results(arguments.output, result, inputs, options, clock, truth, arguments.force)
    print(json.dumps(report.values(), indent=2) if arguments.json else _text(report, arguments.output))
    return 0


def _text(report: Report, output: Path) -> str:
    lines = [
        f"{report.width} x {report.height} px, disparity {report.disparity_px[0]:.1f} to "
        f"{report.disparity_px[1]:.1f} px, depth {report.depth_m[0]:.3f} to {report.depth_m[1]:.3f} m, "
        f"{report.points} points",
        f"valid {report.valid_share:.1%}; {sum(report.seconds.values()):.1f} s in all, "
        f"peak memory {report.peak_memory_gib:.2f} GiB",
        f"{'stage':<24}{'seconds':>9}{'peak GiB':>10}",
    ]
    lines += [f"  {name:<22}{s:>9.1f}{report.peak_gib[name]:>10.2f}" for name, s in report.seconds.items()]
    if report.errors:
        lines.append(
            f"{'error against truth':<24}{'MAE px':>9}{'bad 1':>9}{'bad 2':>9}{'bad 4':>9}{'median z':>10}{'judged':>8}"
        )
        for name, e in report.errors.items():
            share = "".join(f"{e[f'bad_{n}_percent']:>8.1f}%" for n in (1, 2, 4))
            lines.append(
                f"  {name:<22}{e['mae_px']:>9.3f}{share}{e['median_depth_error']:>10.2%}{e['judged_percent']:>7.1f}%"
            )
    lines.append(f"pictures and data: {output}/ (look first at {output / PAGE_NAME})")
    return "\n".join(lines)
