"""``lfstereo depth``: focus sweeps of ordinary cameras, one or two, to depth."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from lfstereo.errors import ConfigError
from lfstereo.focus.alignment import AlignOptions
from lfstereo.focus.importers import ImportOptions
from lfstereo.focus.measures import FocusOptions
from lfstereo.options import add_arguments, from_arguments
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock
from lfstereo.stack_pipeline import StackOptions, SweepOptions, read_pair_rig, run_sweep, run_sweep_pair
from lfstereo.stack_results import StackReport, write_sweep, write_sweep_pair


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("stack", type=Path, help="folder of pictures or RAW files focused at different distances")
    parser.add_argument("right", type=Path, nargs="?", help="the same by a second camera to the right of the first")
    parser.add_argument("--rig", type=Path, help="geometry of the two: OpenCV's stereo calibration, or a rig file")
    parser.add_argument("--distances-right", type=Path, help="CSV of the right sweep; unset: that of the left")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the results")
    parser.add_argument("--force", action="store_true", help="replace an output folder that exists")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    for title, options in (
        ("pictures", ImportOptions),
        ("alignment", AlignOptions),
        ("depth from focus", FocusOptions),
        ("result", SweepOptions),
    ):
        add_arguments(parser.add_argument_group(title), options)  # type: ignore[arg-type]


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_absent(arguments.output, arguments.force)
    options = StackOptions(
        read=from_arguments(ImportOptions, arguments),
        align=from_arguments(AlignOptions, arguments),
        focus=from_arguments(FocusOptions, arguments),
        sweep=from_arguments(SweepOptions, arguments),
    )
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    if arguments.right is None:
        if arguments.rig or arguments.distances_right:
            raise ConfigError("--rig and --distances-right: found one sweep, expected two; give the right one as well")
        result = run_sweep(arguments.stack, options, clock)
        report = write_sweep(arguments.output, result, arguments.stack, options, clock, arguments.force)
        note = "" if result.depth else "; the pictures do not tell their focus distances (--distances FILE.csv)"
    else:
        rig = read_pair_rig(arguments.rig, options.sweep) if arguments.rig else None
        folders = arguments.stack, arguments.right
        pair = run_sweep_pair(*folders, arguments.distances_right, rig, options, clock)
        report = write_sweep_pair(arguments.output, pair, folders, arguments.rig, options, clock, arguments.force)
        note = "" if pair.depth else "; no geometry is known (--rig, or --baseline-m and --focal-px)"
    print(json.dumps(report.values(), indent=2) if arguments.json else _text(report, arguments.output, note))
    return 0


def _text(report: StackReport, output: Path, note: str) -> str:
    parts = [f"{report.width} x {report.height} px, {report.slices} slices"]
    if report.disparity_px:
        parts.append(f"disparity {report.disparity_px[0]:.1f} to {report.disparity_px[1]:.1f} px")
    if report.depth_m:
        parts.append(f"depth {report.depth_m[0]:.3f} to {report.depth_m[1]:.3f} m")
    if report.points:
        parts.append(f"{report.points} points")
    return "\n".join(
        [
            ", ".join(parts) + note,
            f"valid {report.valid_share:.1%}; alignment moved corners by up to {report.moved_px:.1f} px, correlation "
            f"{report.least_correlation:.3f} or more; {sum(report.seconds.values()):.1f} s in all",
            f"pictures and data: {output}/ (look first at {output / 'overview.png'})",
        ]
    )
