"""Compare the stated standard deviations of a calibration with its errors, over many simulated rigs.

Run ``python benchmarks/bench_uncertainty.py [RIGS]`` (two CPU seconds a rig and kind of error; 8 rigs of each kind by
default). Corners are projected through the simulator's lenses, without pictures, and moved at random: each by itself,
or as neighbours of one shot are, alike. Twelve boards each, lenses bent by 1 % in the corners of the frame.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.rig.bundle import solve_rig
from lfstereo.simulate.boards import board_target
from lfstereo.simulate.corners import CornerErrors, corner_session
from lfstereo.simulate.options import SimulateOptions

KINDS = {
    "every view by itself": CornerErrors(view_px=0.3),
    "a corner alike in all views": CornerErrors(corner_px=0.2, view_px=0.05),
    "neighbouring corners alike": CornerErrors(smooth_px=0.2, view_px=0.05),
    "large parts of the board alike": CornerErrors(smooth_px=0.2, reach_m=0.12, view_px=0.05),
}
QUANTITIES = ("baseline", "turn x", "turn y", "turn z", "focal left", "focal right")


def errors_in_sd(seed: int, errors: CornerErrors) -> Float64:
    """Return the errors of six figures of one calibration over their stated standard deviations."""
    options = SimulateOptions(seed=seed, boards=12, board_corners=(8, 5), board_square_m=0.025, distortion_k1=-0.1)
    rig, pairs = corner_session(options, errors)
    truth, sizes = rig.stereo, (rig.left.sensor_px, rig.right.sensor_px)
    found = solve_rig(pairs, board_target(options).points, sizes, truth.pixel_px)
    turn = Rotation.from_matrix(found.rig.right_from_left @ truth.right_from_left.T).as_rotvec()
    focal = [found.rig.left.focal_px[0] / rig.left.focal_px - 1, found.rig.right.focal_px[0] / rig.right.focal_px - 1]
    baseline = (found.rig.baseline_m - truth.baseline_m) / found.baseline_sd_m
    return np.array([baseline, *(turn / found.rotation_sd_rad), *(np.array(focal) / found.focal_sd)])


def main() -> None:
    """Print the rms of the errors in standard deviations, and how many exceed two and three of them."""
    rigs = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    print(
        f"{'errors of corners':<32}" + "".join(f"{name:>12}" for name in QUANTITIES) + f"{'all':>7}{'> 2':>7}{'> 3':>7}"
    )
    for kind, errors in KINDS.items():
        found = np.abs([errors_in_sd(seed, errors) for seed in range(1, rigs + 1)])
        each = "".join(f"{np.sqrt(np.mean(column**2)):>12.2f}" for column in found.T)
        shares = "".join(f"{np.mean(found > limit):>7.1%}" for limit in (2, 3))
        print(f"{kind:<32}{each}{np.sqrt(np.mean(found**2)):>7.2f}{shares}", flush=True)


if __name__ == "__main__":
    main()
