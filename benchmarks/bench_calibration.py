"""Calibrate a simulated full-size rig from 12 photographs of a board, and compare it with the rig that was simulated.

Run ``python benchmarks/bench_calibration.py`` (a quarter of an hour of one core: 26 captures are simulated), or give it
the folder of a session simulated before: ``lfstereo simulate --boards 12 --distortion-k1 -0.1 -o SESSION``. The
photographs are LFR files; nothing of the truth goes into the calibration but the size of the board's squares.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.cli.main import main as lfstereo
from lfstereo.options import from_mapping, read_toml
from lfstereo.rig.bundle import RigSolution, solve_rig
from lfstereo.rig.geometry import Side, rectified_geometry
from lfstereo.rig.rig import StereoRig
from lfstereo.rig.session import Session, see_targets
from lfstereo.rig.shots import pair_shots
from lfstereo.rig.target import Target, read_target
from lfstereo.rig.view_maps import rectify_places
from lfstereo.simulate.corners import seen_places
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig, build_rig

SIDES: tuple[Side, Side] = ("left", "right")
BOARDS, DISTORTION_K1 = 12, -0.1
VIEWS, VIEW_STEP_PX = 15, 0.884
TARGETS = {"baseline": 0.2, "rotation": 0.02, "rows": 0.1, "depth": 0.5, "deviations": 3.0}
NEAR_1M = (0.93, 1.07)


def row_parallax_px(simulated: SimulatedRig, found: StereoRig) -> tuple[float, float]:
    """Return rms and largest difference of rows, right minus left, over the frame, the range and all views, px."""
    geometry, truth = rectified_geometry(found), simulated.stereo
    rng = np.random.default_rng(0)
    z = 1 / rng.uniform(1 / truth.far_m, 1 / truth.near_m, 400)
    place = rng.uniform(0, 1, (400, 2)) * truth.left.sensor_px
    points = np.column_stack([(place - truth.left.principal_px) / truth.left.focal_px * z[:, None], z])
    in_right = points @ truth.right_from_left.T + truth.translation_m
    at_centre = seen_places(simulated.right, in_right, np.zeros((1, 2)))[0]
    common = np.all((at_centre > 0) & (at_centre < truth.right.sensor_px), axis=1)
    closest = min(found.left.pupil_m_per_px, found.right.pupil_m_per_px)
    misses = []
    for view in np.ndindex(VIEWS, VIEWS):
        steps = (np.array(view[::-1]) - VIEWS // 2) * VIEW_STEP_PX
        if np.hypot(*steps) > VIEWS // 2 * VIEW_STEP_PX:
            continue  # Beyond the round aperture.
        rows = []
        for side, seen in (("left", points[common]), ("right", in_right[common])):
            camera = getattr(found, side)
            offset = steps * closest / camera.pupil_m_per_px
            places = seen_places(getattr(simulated, side), seen, offset[None])[0]
            rows.append(rectify_places(places, offset, camera, geometry, side)[:, 1])
        misses.append(rows[1] - rows[0])
    miss = np.concatenate(misses)
    return float(np.sqrt(np.mean(miss**2))), float(np.abs(miss).max())


def corner_depths(folder: Path, target: Target, solution: RigSolution) -> tuple[Float64, Float64]:
    """Return the true depths of all measured corners in left camera axes and the triangulated ones, m."""
    table = tomllib.loads((folder / "boards" / "poses.toml").read_text("utf-8"))
    truth = {Path(shot["left"]).stem.replace("left", ""): shot for shot in table["shot"]}
    geometry = rectified_geometry(solution.rig)
    true, found = [], []
    for pair in solution.pairs:
        pose = truth[Path(pair.left.source).stem.replace("left", "")]
        points = target.points @ Rotation.from_rotvec(pose["rotation_rad"]).as_matrix().T + pose["translation_m"]
        (number, left), (other, right) = pair.left.centre_view(), pair.right.centre_view()
        both, in_left, in_right = np.intersect1d(number, other, return_indices=True)
        a = rectify_places(left[in_left], np.zeros(2), solution.rig.left, geometry, "left")
        b = rectify_places(right[in_right], np.zeros(2), solution.rig.right, geometry, "right")
        z = geometry.focal_px * geometry.baseline_m / (a[:, 0] - b[:, 0] + geometry.doffs_px)
        xy = (a - geometry.left.principal_px) / geometry.focal_px * z[:, None]
        found.append((np.column_stack([xy, z]) @ geometry.left.rectified_from_camera)[:, 2])
        true.append(points[both, 2])
    return np.concatenate(true), np.concatenate(found)


def report(folder: Path, session: Session, target: Target, solution: RigSolution) -> None:
    """Print each figure beside its target."""
    table = read_toml(folder / "simulation.toml")["simulate"]
    simulated = build_rig(from_mapping(SimulateOptions, table, "simulation.toml"))
    rig, truth = solution.rig, simulated.stereo
    turn = Rotation.from_matrix(rig.right_from_left @ truth.right_from_left.T)
    baseline = rig.baseline_m - truth.baseline_m
    focal = [getattr(rig, side).focal_px[0] / getattr(truth, side).focal_px[0] - 1 for side in SIDES]
    deviations = np.array([baseline / solution.baseline_sd_m, *(turn.as_rotvec() / solution.rotation_sd_rad)])
    deviations = np.abs(np.concatenate([deviations, np.array(focal) / solution.focal_sd]))
    rows, most = row_parallax_px(simulated, rig)
    floor, _ = row_parallax_px(simulated, truth)
    true, found = corner_depths(folder, target, solution)
    near = (true > NEAR_1M[0]) & (true < NEAR_1M[1])
    error = np.abs(found / true - 1)[near]
    views = session.pixel_px
    print(f"{'figure':<58}{'found':>10}{'target':>10}")
    lines = (
        ("baseline error, %", 100 * abs(baseline) / truth.baseline_m, TARGETS["baseline"]),
        ("rotation error, degrees", math.degrees(turn.magnitude()), TARGETS["rotation"]),
        ("vertical parallax, whole light field, px rms", rows, TARGETS["rows"]),
        ("  the same with the true rig", floor, None),
        ("  largest", most, None),
        (f"depth of {near.sum()} measured corners near 1 m, largest error, %", 100 * error.max(), TARGETS["depth"]),
        ("  rms, %", 100 * float(np.sqrt(np.mean(error**2))), None),
        ("largest of 6 errors over its standard deviation", deviations.max(), TARGETS["deviations"]),
        ("  their rms", float(np.sqrt(np.mean(deviations**2))), None),
        ("focal length error, left, %", 100 * focal[0], None),
        ("focal length error, right, %", 100 * focal[1], None),
        ("residual of a corner, px of a view", solution.sigma_px / views, None),
    )
    for name, value, limit in lines:
        print(f"{name:<58}{value:>10.4f}{'' if limit is None else f'{limit:>10g}'}")
    print(f"rotation error about x, y, z, degrees: {np.degrees(turn.as_rotvec()).round(4).tolist()}")
    print(f"standard deviations: {np.degrees(solution.rotation_sd_rad).round(4).tolist()}", end="; ")
    print(f"baseline {baseline * 1e6:+.1f} +- {solution.baseline_sd_m * 1e6:.1f} um")


def main() -> None:
    """Simulate where needed, calibrate, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session", type=Path, nargs="?", help="folder written by 'lfstereo simulate --boards N'")
    folder = parser.parse_args().session
    with tempfile.TemporaryDirectory() as scratch:
        if folder is None:
            folder = Path(scratch) / "session"
            boards = ["--boards", str(BOARDS), "--distortion-k1", str(DISTORTION_K1)]
            if lfstereo(["simulate", "-o", str(folder), *boards]):
                raise SystemExit("the simulation failed")
        target = read_target(folder / "boards" / "target.toml")
        started, cpu = time.perf_counter(), time.process_time()
        session = see_targets(pair_shots(folder / "boards", folder / "boards"), target, folder / "whites")
        seen, seen_cpu = time.perf_counter() - started, time.process_time() - cpu
        cpu = time.process_time()
        shown = (session.pairs, target.points, session.sizes_px, session.pixel_px)
        solution = solve_rig(*shown, lenses=session.lenses)
        solved = time.process_time() - cpu
        print(f"{len(session.pairs)} shots: captures and corners {seen_cpu:.0f} CPU s ({seen:.0f} s), ", end="")
        print(f"adjustment {solved:.1f} CPU s; rejected: {list(solution.rejected)}")
        report(folder, session, target, solution)


if __name__ == "__main__":
    main()
