"""Random simulated rigs, from raw captures to metres: how far from the truth the depth is, and which rigs fail.

Run ``python benchmarks/bench_end_to_end.py FOLDER [--rigs 20] [--boards 5]``. Each rig differs in focal length,
aperture (and with it vignetting), focus, distortion, baseline, working range, exposure, noise and scene. Its board
shots are photographed and calibrated, its scene is photographed and run, all through the commands that a user types
and at full sensor size; the depth of every pixel is compared with the scene's. Seven minutes of one core a rig. What
was measured is kept in ``FOLDER/rigs.jsonl``; started again, it goes on where it was, and prints the table of all.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tifffile
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Bool, Float32
from lfstereo.cli.main import main as lfstereo
from lfstereo.options import to_toml
from lfstereo.rig.geometry import rectified_geometry
from lfstereo.rig.rig import StereoRig, read_rig
from lfstereo.simulate.camera import LENSLET_PITCH_M
from lfstereo.simulate.options import SimulateOptions

SEED = 4
RAYS = 1
"""Per sensor pixel, a quarter of the usual: what one ray misses is one more noise."""
QUANTILES = (0.5, 0.9, 0.99)
"""Of the error of all depths told of one rig."""
_BOARD = SimulateOptions()
"""The options for which the board of 19 x 14 corners of 10 mm fills the view."""


def drawn(number: int, boards: int) -> SimulateOptions:
    """Draw a rig, its light and its scene."""
    rng = np.random.default_rng([SEED, number])

    def even(low: float, high: float, logarithmic: bool = False) -> float:
        value = math.exp(rng.uniform(math.log(low), math.log(high))) if logarithmic else rng.uniform(low, high)
        return float(f"{value:.4g}")

    focal_m, near_m = even(0.012, 0.036, True), even(0.4, 1.2, True)
    far_m = float(f"{near_m * even(1.3, 3.0):.4g}")
    range_per_m = 1 / near_m - 1 / far_m
    baseline_m = even(25, 95) / (focal_m / (LENSLET_PITCH_M * math.sqrt(3) / 2) * range_per_m)
    return SimulateOptions(
        seed=100 + number,
        focal_length_m=focal_m,
        f_number=even(1.9, 2.5),
        focus_m=float(f"{1 / (1 / far_m + even(0.3, 0.7) * range_per_m):.4g}"),
        distortion_k1=even(-0.2, 0.1),
        baseline_m=float(f"{min(max(baseline_m, 0.04), 0.4):.4g}"),
        near_m=near_m,
        far_m=far_m,
        exposure=even(0.15, 1.5, True),
        full_well_e=even(800, 10000, True),
        read_noise_dn=even(1, 4),
        samples=RAYS,
        boards=boards,
        board_square_m=float(f"{0.010 * (_BOARD.focal_length_m / focal_m) * (near_m / _BOARD.near_m):.3g}"),
    )


def measured(folder: Path, options: SimulateOptions) -> dict[str, Any]:
    """Simulate, calibrate and run; return the errors of what it tells, or which command refused."""
    capture, rig, result = folder / "capture", folder / "rig.toml", folder / "result"
    (folder / "options.toml").write_text("[simulate]\n" + to_toml(options), "utf-8")
    boards, whites = str(capture / "boards"), str(capture / "whites")
    shots, target = ["calibrate", boards, boards], ["--target", str(capture / "boards" / "target.toml")]
    limits = ["--near-m", str(options.near_m), "--far-m", str(options.far_m)]
    pair = ["run", str(capture / "left.LFR"), str(capture / "right.LFR"), "--rig", str(rig)]
    commands = (
        ["simulate", "--config", str(folder / "options.toml"), "-o", str(capture)],
        [*shots, *target, "--whites", whites, *limits, "-o", str(rig)],
        [*pair, "--whites", whites, "-o", str(result)],
    )
    for words in commands:
        if code := lfstereo(words):
            return {"refused": f"{words[0]}, exit code {code}"}
    found, truth = read_rig(rig), read_rig(capture / "rig.toml")
    turn = Rotation.from_matrix(found.right_from_left @ truth.right_from_left.T).magnitude()
    errors, known = depth_errors(tifffile.imread(result / "depth.tiff"), found, capture / "truth", truth)
    told = errors[known & np.isfinite(errors)]
    return {
        "baseline_percent": 100 * abs(found.baseline_m / truth.baseline_m - 1),
        "rotation_degrees": math.degrees(turn),
        "told_percent": 100 * told.size / max(int(known.sum()), 1),
        "depth_percent": [100 * float(q) for q in np.quantile(told, QUANTILES)] if told.size else None,
    }


def depth_errors(depth_m: Float32, rig: StereoRig, truth: Path, true_rig: StereoRig) -> tuple[Float32, Bool]:
    """Return ``(V, U)`` |z / z_true - 1|, NaN where no depth is told, and where both sensors see the place.

    The calibrated rig looks in a slightly other direction than the true one, so each point found is looked up where the
    true rig sees it.
    """
    ours, theirs = rectified_geometry(rig).left, rectified_geometry(true_rig).left
    focal_px, true_focal_px = rectified_geometry(rig).focal_px, rectified_geometry(true_rig).focal_px
    v, u = np.indices(depth_m.shape)
    rays = np.stack([u - ours.principal_px[0], v - ours.principal_px[1], np.full(u.shape, focal_px)], -1) / focal_px
    seen = rays @ (theirs.rectified_from_camera @ ours.rectified_from_camera.T).T
    found = np.where(depth_m > 0, depth_m, np.nan) * seen[..., 2]
    places = seen[..., :2] / seen[..., 2:] * true_focal_px + theirs.principal_px
    x, y = np.moveaxis(np.rint(places).astype(int), -1, 0)
    true = tifffile.imread(truth / "depth.tiff")
    valid = cv2.imread(str(truth / "valid.png"), cv2.IMREAD_GRAYSCALE)
    assert valid is not None
    inside = (x >= 0) & (x < true.shape[1]) & (y >= 0) & (y < true.shape[0])
    x, y = np.where(inside, x, 0), np.where(inside, y, 0)
    return np.abs(found / true[y, x] - 1).astype(np.float32), inside & (valid[y, x] > 0)


def print_table(rows: list[dict[str, Any]]) -> None:
    """Print a line per rig, then the distribution over the rigs that gave depth."""
    shares = "".join(f"{f'{100 * q:.0f} % below':>12}" for q in QUANTILES)
    print(
        f"{'rig':<5}{'f mm':>6}{'B mm':>6}{'range m':>14}{'light':>6}{'told':>7}{'B off %':>9}{'turn deg':>9}{shares}"
    )
    for row in rows:
        rig = row["options"]
        head = f"{row['number']:<5}{1e3 * rig['focal_length_m']:>6.1f}{1e3 * rig['baseline_m']:>6.0f}"
        head += f"{rig['near_m']:>7.2f}{rig['far_m']:>7.2f}{rig['exposure']:>6.2f}"
        if "refused" in row:
            print(f"{head}  refused: {row['refused']}")
            continue
        errors = "".join(f"{value:>12.2f}" for value in row["depth_percent"] or ())
        print(
            f"{head}{row['told_percent']:>6.0f}%{row['baseline_percent']:>9.4f}{row['rotation_degrees']:>9.4f}{errors}"
        )
    good = [row for row in rows if row.get("depth_percent")]
    print(f"{len(good)} of {len(rows)} rigs gave depth")
    for name, index in (("median", 0), ("90 % quantile", 1)):
        values = np.array([row["depth_percent"][index] for row in good])
        low, middle, high = np.quantile(values, (0, 0.5, 1))
        print(f"{name} of the depth error over the rigs, %: best {low:.2f}, middle {middle:.2f}, worst {high:.2f}")


def main() -> None:
    """Measure the rigs that are not in the file yet; print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rigs", type=int, default=20)
    parser.add_argument("--boards", type=int, default=5, help="board shots of each rig")
    parser.add_argument("--keep", action="store_true", help="keep the captures, 1 GB a rig")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    record = arguments.folder / "rigs.jsonl"
    rows = [json.loads(line) for line in record.read_text("utf-8").splitlines()] if record.exists() else []
    for number in range(arguments.rigs):
        if any(row["number"] == number for row in rows):
            continue
        folder = arguments.folder / f"rig{number:02d}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        options = drawn(number, arguments.boards)
        started = time.perf_counter()
        row = {"number": number, "options": asdict(options)} | measured(folder, options)
        row["seconds"] = time.perf_counter() - started
        rows.append(row)
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        if not arguments.keep:
            shutil.rmtree(folder / "capture", ignore_errors=True)
    print_table(sorted(rows, key=lambda row: int(row["number"])))


if __name__ == "__main__":
    main()
