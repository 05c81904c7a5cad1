"""``lfstereo calibrate``: photographs of a target by both cameras to a rig."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfstereo.errors import ConfigError
from lfstereo.options import add_arguments, from_arguments, read_toml
from lfstereo.outputs import check_absent
from lfstereo.progress import StageClock

if TYPE_CHECKING:
    from lfstereo.rig.bundle import RigSolution
    from lfstereo.rig.session import Session


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.rig.bundle import RigOptions
    from lfstereo.rig.corners import CornerOptions

    parser.add_argument("left", type=Path, help="folder with the left camera's photographs of the target")
    parser.add_argument("right", type=Path, help="folder with the right camera's; may be the same")
    parser.add_argument("--target", type=Path, required=True, help="TOML file of the target")
    parser.add_argument("--whites", type=Path, help="folder with the cameras' white images; needed for raw captures")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="rig file to write (.toml), a report beside it"
    )
    parser.add_argument("--drop", nargs="+", default=[], metavar="NAME", help="shots to leave out, by name")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--force", action="store_true", help="replace outputs that exist")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    add_arguments(parser, RigOptions)
    add_arguments(parser, CornerOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from lfstereo.rig.bundle import RigOptions, solve_rig
    from lfstereo.rig.calibration_report import write_report
    from lfstereo.rig.corners import CornerOptions
    from lfstereo.rig.rig import write_rig
    from lfstereo.rig.session import see_targets
    from lfstereo.rig.shots import pair_shots
    from lfstereo.rig.target import read_target

    report = arguments.output.with_suffix(".png")
    check_absent(arguments.output, arguments.force)
    check_absent(report, arguments.force)
    tables = read_toml(arguments.config) if arguments.config else {}
    options = from_arguments(RigOptions, arguments, tables.get("rig", {}), f"{arguments.config} [rig]")
    corners = from_arguments(CornerOptions, arguments, tables.get("corners", {}), f"{arguments.config} [corners]")
    target = read_target(arguments.target)
    shots = pair_shots(arguments.left, arguments.right)
    unknown = set(arguments.drop) - {name for name, *_ in shots}
    if unknown:
        raise ConfigError(
            f"--drop: found no shot {', '.join(sorted(unknown))}, expected some of {', '.join(n for n, *_ in shots)}"
        )
    shots = [shot for shot in shots if shot[0] not in arguments.drop]
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    with clock.stage("find the target") as progress:
        session = see_targets(shots, target, arguments.whites, corners, progress)
    for name, reason in session.unusable:
        print(f"shot {name} left out: {reason}", file=sys.stderr)
    with clock.stage("solve") as progress:
        solution = solve_rig(session.pairs, target.points, session.sizes_px, session.pixel_px, options, progress)
    write_rig(arguments.output, session.labelled(solution.rig), arguments.force)
    write_report(report, solution, target.points, arguments.force)
    summary = _summary(solution, session, clock)
    print(json.dumps(summary, indent=2) if arguments.json else _text(summary, arguments.output, report))
    return 0


def _summary(solution: RigSolution, session: Session, clock: StageClock) -> dict[str, Any]:
    rig = solution.rig
    return {
        "serials": [rig.left.serial, rig.right.serial],
        "baseline_m": rig.baseline_m,
        "baseline_sd_m": solution.baseline_sd_m,
        "rotation_rad": rig.rotation_rad,
        "rotation_sd_rad": solution.rotation_sd_rad,
        "focal_px": [rig.left.focal_px, rig.right.focal_px],
        "range_m": [rig.near_m, rig.far_m],
        "residual_px": solution.sigma_px,
        "shots": [{"name": e.name, "side": e.side, "rms_px": e.rms_px, "corners": e.corners} for e in solution.errors],
        "rejected": list(solution.rejected),
        "without_target": [name for name, _ in session.unusable],
        "seconds": clock.seconds,
    }


def _text(summary: dict[str, Any], output: Path, report: Path) -> str:
    turn = math.degrees(math.hypot(*summary["rotation_rad"]))
    turn_sd = math.degrees(max(summary["rotation_sd_rad"]))
    worst = max(summary["shots"], key=lambda shot: float(shot["rms_px"]))
    lines = [
        f"baseline {summary['baseline_m'] * 1e3:.3f} +- {summary['baseline_sd_m'] * 1e3:.3f} mm, the right camera "
        f"turned by {turn:.3f} +- {turn_sd:.3f} degrees",
        f"{len(summary['shots']) // 2} shots used, residual {summary['residual_px']:.2f} sensor px, worst shot "
        f"{worst['name']} {worst['side']} ({worst['rms_px']:.2f} px)",
    ]
    if summary["rejected"]:
        lines.append(f"rejected, as they contradict the others: {', '.join(summary['rejected'])}")
    lines.append(", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items()))
    lines.append(f"rig: {output} (look first at {report})")
    return "\n".join(lines)
