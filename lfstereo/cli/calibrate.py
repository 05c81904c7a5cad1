"""``lfstereo calibrate``: photographs of a target by both cameras to a rig; drift of a rig from other captures."""

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
    from lfstereo.rig.drift import Drift
    from lfstereo.rig.session import Session


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    from lfstereo.rig.bundle import RigOptions
    from lfstereo.rig.corners import CornerOptions

    parser.add_argument(
        "captures",
        type=Path,
        nargs="+",
        help="folders with the left and with the right camera's photographs of the target, may be one; with --refine "
        "captures of any scene, left and right in turn, or two folders",
    )
    parser.add_argument("--target", type=Path, help="TOML file of the target")
    parser.add_argument(
        "--refine",
        type=Path,
        metavar="RIG",
        help="say whether this rig has moved, from ordinary captures, not a target",
    )
    parser.add_argument(
        "--whites", type=Path, help="folder with the cameras' white images, of raw captures; else those imported before"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        help="rig file to write (.toml), a page and a picture of how good it is beside it; not needed with --refine",
    )
    parser.add_argument("--drop", nargs="+", default=[], metavar="NAME", help="shots to leave out, by name")
    parser.add_argument(
        "--any-zoom", action="store_true", help="with --refine: accept captures at another zoom or focus"
    )
    parser.add_argument("--any-camera", action="store_true", help="with --refine: accept captures of other cameras")
    parser.add_argument("--config", type=Path, help="TOML file with options; the command line goes before it")
    parser.add_argument("--keep-serials", action="store_true", help="write camera serial numbers, not only their marks")
    parser.add_argument("--force", action="store_true", help="replace outputs that exist")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON on stdout")
    add_arguments(parser, RigOptions)
    add_arguments(parser, CornerOptions)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    return _refine(arguments) if arguments.refine else _calibrate(arguments)


def _calibrate(arguments: argparse.Namespace) -> int:
    from lfstereo.rig.bundle import RigOptions, solve_rig
    from lfstereo.rig.calibration_report import write_report
    from lfstereo.rig.corners import CornerOptions
    from lfstereo.rig.rig import without_serials, write_rig
    from lfstereo.rig.session import see_targets
    from lfstereo.rig.shots import pair_shots
    from lfstereo.rig.target import read_target
    from lfstereo.viewer.calibration import write_calibration_page

    if arguments.target is None or arguments.output is None:
        raise ConfigError("calibrate: found no --target or no -o, expected both to calibrate, or --refine RIG")
    if len(arguments.captures) > 2:
        raise ConfigError(
            f"calibrate: found {len(arguments.captures)} folders, expected the left camera's photographs and the right "
            "camera's; for captures of other scenes give --refine"
        )
    report, page = (arguments.output.with_suffix(suffix) for suffix in (".png", ".html"))
    for path in (arguments.output, report, page):
        check_absent(path, arguments.force)
    tables = read_toml(arguments.config) if arguments.config else {}
    options = from_arguments(RigOptions, arguments, tables.get("rig", {}), f"{arguments.config} [rig]")
    corners = from_arguments(CornerOptions, arguments, tables.get("corners", {}), f"{arguments.config} [corners]")
    target = read_target(arguments.target)
    shots = _without(pair_shots(arguments.captures[0], arguments.captures[-1]), arguments.drop)
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    with clock.stage("find the target") as progress:
        session = see_targets(shots, target, arguments.whites, corners, progress)
    for name, reason in session.unusable:
        print(f"shot {name} left out: {reason}", file=sys.stderr)
    with clock.stage("solve") as progress:
        shown = (session.pairs, target.points, session.sizes_px, session.pixel_px)
        solution = solve_rig(*shown, options, progress, session.lenses)
    rig = session.labelled(solution.rig)
    write_rig(arguments.output, rig if arguments.keep_serials else without_serials(rig), arguments.force)
    write_report(report, solution, target.points, arguments.force)
    files = {"the rig": arguments.output, "this page as one picture": report}
    write_calibration_page(page, solution, session, target.points, files, arguments.force)
    summary = _summary(solution, session, clock)
    print(json.dumps(summary, indent=2) if arguments.json else _text(summary, arguments.output, page))
    return 0


def _without(shots: list[tuple[str, Path, Path]], drop: list[str]) -> list[tuple[str, Path, Path]]:
    unknown = set(drop) - {name for name, *_ in shots}
    if unknown:
        raise ConfigError(
            f"--drop: found no shot {', '.join(sorted(unknown))}, expected some of {', '.join(n for n, *_ in shots)}"
        )
    return [shot for shot in shots if shot[0] not in drop]


def _refine(arguments: argparse.Namespace) -> int:
    from lfstereo.rig.drift import estimate_drift
    from lfstereo.rig.features import join_matches, match_features
    from lfstereo.rig.geometry import rectified_geometry
    from lfstereo.rig.match import check_camera, check_lens
    from lfstereo.rig.rig import read_rig, write_rig
    from lfstereo.rig.session import ShotSide
    from lfstereo.rig.shots import pair_captures

    if arguments.output is not None:
        check_absent(arguments.output, arguments.force)
    rig = read_rig(arguments.refine)
    geometry = rectified_geometry(rig)
    shots = _without(pair_captures(arguments.captures), arguments.drop)
    sides = (ShotSide("left", arguments.whites), ShotSide("right", arguments.whites))
    clock = StageClock(bars=sys.stderr.isatty() or not arguments.json)
    parts = []
    with clock.stage("match features") as progress:
        for done, (_, *paths) in enumerate(shots):
            fields = [side.open(path) for side, path in zip(sides, paths, strict=True)]
            for field, side in zip(fields, sides, strict=True):
                camera = rig.left if side.name == "left" else rig.right
                check_camera(field, camera, side.name, arguments.any_camera)
                if not arguments.any_zoom:
                    check_lens(field, camera, side.name)
            parts.append(match_features(fields[0], fields[1], rig, geometry))
            progress(done + 1, len(shots))
    drift = estimate_drift(rig, join_matches(parts))
    if arguments.output is not None:
        write_rig(arguments.output, drift.rig, arguments.force)
    summary = _drift_summary(drift, len(shots), clock)
    print(json.dumps(summary, indent=2) if arguments.json else _drift_text(summary, arguments.output))
    return 0


def _drift_summary(drift: Drift, captures: int, clock: StageClock) -> dict[str, Any]:
    return {
        "moved": drift.moved,
        "captures": captures,
        "matches": drift.matches,
        "rotation_rad": drift.rotation_rad.tolist(),
        "rotation_sd_rad": drift.rotation_sd_rad.tolist(),
        "height_m": drift.height_m,
        "height_sd_m": drift.height_sd_m,
        "row_parallax_px": [drift.parallax_before_px, drift.parallax_px],
        "moved_px": drift.moved_px,
        "seconds": clock.seconds,
    }


def _drift_text(summary: dict[str, Any], output: Path | None) -> str:
    turns = ", ".join(
        f"{math.degrees(turn):+.4f} +- {math.degrees(sd):.4f}"
        for turn, sd in zip(summary["rotation_rad"], summary["rotation_sd_rad"], strict=True)
    )
    before, after = summary["row_parallax_px"]
    verdict = "the rig has MOVED since its calibration" if summary["moved"] else "the rig has not moved"
    lines = [
        f"{verdict}: rows of {summary['matches']} features in {summary['captures']} pair(s) of captures are off by "
        f"{summary['moved_px']:.3f} px rms (scatter {after:.3f} px)",
        f"right camera turned about x, y, z by {turns} degrees, lower by {summary['height_m'] * 1e3:+.3f} +- "
        f"{summary['height_sd_m'] * 1e3:.3f} mm",
        f"vertical parallax {before:.3f} px rms with the rig as it was, {after:.3f} px as it is now",
    ]
    if output is not None:
        lines.append(f"rig as it is now: {output}")
    elif summary["moved"]:
        lines.append("write the rig as it is now with -o, or calibrate again")
    return "\n".join(lines)


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
        "lenses": _lenses(solution, session),
        "shots": [{"name": e.name, "side": e.side, "rms_px": e.rms_px, "corners": e.corners} for e in solution.errors],
        "rejected": list(solution.rejected),
        "without_target": [name for name, _ in session.unusable],
        "seconds": clock.seconds,
    }


def _lenses(solution: RigSolution, session: Session) -> list[dict[str, float]]:
    """Return both lenses as found and as the metadata tell, where raw captures did."""
    from lfstereo.rig.thin_lens import thin_lens_of_camera

    told = []
    for camera, start in zip((solution.rig.left, solution.rig.right), session.lenses, strict=True):
        if start is not None:
            found = thin_lens_of_camera(camera, start)
            told.append(
                {
                    "focal_length_m": found.focal_length_m,
                    "focal_length_m_metadata": start.focal_length_m,
                    "lenslet_gap_m": found.lenslet_gap_m,
                    "lenslet_gap_m_metadata": start.lenslet_gap_m,
                }
            )
    return told


def _text(summary: dict[str, Any], output: Path, page: Path) -> str:
    turn = math.degrees(math.hypot(*summary["rotation_rad"]))
    turn_sd = math.degrees(max(summary["rotation_sd_rad"]))
    worst = max(summary["shots"], key=lambda shot: float(shot["rms_px"]))
    lines = [
        f"baseline {summary['baseline_m'] * 1e3:.3f} +- {summary['baseline_sd_m'] * 1e3:.3f} mm, the right camera "
        f"turned by {turn:.3f} +- {turn_sd:.3f} degrees",
        f"{len(summary['shots']) // 2} shots used, residual {summary['residual_px']:.2f} sensor px, worst shot "
        f"{worst['name']} {worst['side']} ({worst['rms_px']:.2f} px)",
    ]
    for side, lens in zip(("left", "right"), summary["lenses"], strict=False):
        lines.append(
            f"{side} lens {lens['focal_length_m'] * 1e3:.2f} mm, its lenslets {lens['lenslet_gap_m'] * 1e6:.2f} um "
            f"before the sensor; metadata {lens['focal_length_m_metadata'] * 1e3:.2f} mm, "
            f"{lens['lenslet_gap_m_metadata'] * 1e6:.2f} um"
        )
    if summary["rejected"]:
        lines.append(f"rejected, as they contradict the others: {', '.join(summary['rejected'])}")
    lines.append(", ".join(f"{name} {seconds:.1f} s" for name, seconds in summary["seconds"].items()))
    lines.append(f"rig: {output} (look first at {page})")
    return "\n".join(lines)
