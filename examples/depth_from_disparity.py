"""Turn a disparity map into metres, a point cloud and a colour picture with a scale.

The disparity map is made here: a ball of 8 cm radius, 0.8 m away, before a wall at 1.2 m. In practice it is
``disparity.pfm`` of a result folder, and the geometry stands in its ``run.toml``.
"""

import sys
from pathlib import Path

import numpy as np

from lfstereo.depth.colormap import DisparityScale, picture_disparity
from lfstereo.depth.pfm import read_pfm, write_pfm
from lfstereo.depth.pictures import write_png
from lfstereo.depth.ply import write_ply
from lfstereo.depth.points import points_from_depth
from lfstereo.depth.triangulate import disparity_of, triangulate

FOCAL_PX, BASELINE_M, DOFFS_PX = 1156.0, 0.1, 90.0
CENTRE_PX = (312.0, 217.0)
BALL_M, RADIUS_M, WALL_M = 0.8, 0.08, 1.2


def true_depth() -> np.ndarray:
    """Return ``(434, 625)`` metres: the nearer hit of each pixel's ray with the ball and the wall."""
    v, u = np.mgrid[:434, :625]
    x, y = (u - CENTRE_PX[0]) / FOCAL_PX, (v - CENTRE_PX[1]) / FOCAL_PX
    # Points z (x, y, 1) with distance RADIUS_M from (0, 0, BALL_M): a z^2 - 2 BALL_M z + c = 0.
    a, c = x**2 + y**2 + 1, BALL_M**2 - RADIUS_M**2
    root = BALL_M**2 - a * c
    ball = (BALL_M - np.sqrt(np.maximum(root, 0))) / a
    return np.where(root > 0, ball, WALL_M).astype(np.float32)


def main(folder: Path) -> None:
    """Write disparity.pfm, read it back, write points and picture."""
    write_pfm(folder / "disparity.pfm", disparity_of(true_depth(), FOCAL_PX, BASELINE_M, DOFFS_PX), force=True)
    disparity, known = read_pfm(folder / "disparity.pfm")
    depth = triangulate(disparity, known, FOCAL_PX, BASELINE_M, DOFFS_PX)
    grey = np.full((*disparity.shape, 3), 0.5, np.float32)
    cloud = points_from_depth(depth, grey, FOCAL_PX, CENTRE_PX)
    write_ply(folder / "points.ply", cloud, force=True)
    scale = DisparityScale(float(disparity.max()), 0.0, FOCAL_PX, BASELINE_M, DOFFS_PX)
    write_png(folder / "disparity_colour.png", picture_disparity(disparity, depth.valid, scale), force=True)
    on_ball = cloud.points_m[cloud.points_m[:, 2] < 1.0]
    radius = np.linalg.norm(on_ball - [0, 0, BALL_M], axis=1)
    print(f"{len(cloud.points_m)} points; ball radius {100 * np.median(radius):.2f} cm, expected {100 * RADIUS_M:.2f}")


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "depth")
    target.mkdir(parents=True, exist_ok=True)
    main(target)
