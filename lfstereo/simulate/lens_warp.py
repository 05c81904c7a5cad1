"""The inner loop of the Virtual DSLR: one slice, integrated over points of the lens."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64
from lfstereo.simulate.compiled import compiled

FAR = -1e9
Int32 = npt.NDArray[np.int32]
_SAME_SURFACE_PX = 1.0


@compiled
def integrate_lens(
    image: Float32, disparity: Float32, points: Float64, focus: float, reach: int, total: Float32
) -> None:
    """Add to ``total`` what each point of the lens sees, moved so that the focal plane stays in place.

    Every pixel goes to ``x - u (d - focus)``; where several meet, the largest disparity wins; what no pixel reaches
    takes the farther of the two surfaces on either side along the direction of ``u``. Colours are read between pixels
    of one surface only, so none leaks across a depth edge.

    Parameters
    ----------
    image
        ``(H, W, 3)`` float32 linear.
    disparity
        ``(H, W)`` float32 px.
    points
        ``(N, 2)`` offset ``u`` of each lens point in baselines, x and y.
    focus
        Disparity in focus, px.
    reach
        Farthest pixel that is looked at when a hole is filled, px.
    total
        ``(H, W, 3)`` float32, added to in place.
    """
    height, width = disparity.shape
    nearest = np.empty((height, width), np.float32)
    source = np.empty((height, width), np.int32)
    for n in range(len(points)):
        u_x, u_y = np.float32(points[n, 0]), np.float32(points[n, 1])
        _warp(disparity, u_x, u_y, np.float32(focus), nearest, source)
        length = np.float32(max(np.sqrt(u_x * u_x + u_y * u_y), 1e-6))
        for r in range(height):
            for c in range(width):
                found = source[r, c]
                if found < 0:
                    found = _behind(nearest, source, r, c, u_x / length, u_y / length, reach)
                    if found >= 0:
                        for k in range(3):
                            total[r, c, k] += image[found // width, found % width, k]
                    continue
                _fetch(image, disparity, u_x, u_y, np.float32(focus), found, r, c, total)


@compiled
def _warp(
    disparity: Float32, u_x: np.float32, u_y: np.float32, focus: np.float32, nearest: Float32, source: Int32
) -> None:
    height, width = disparity.shape
    nearest[:] = FAR
    source[:] = -1
    half = np.float32(0.5)
    for r in range(height):
        for c in range(width):
            d = disparity[r, c]
            s = d - focus
            i, j = int(np.floor(r - u_y * s + half)), int(np.floor(c - u_x * s + half))
            if 0 <= i < height and 0 <= j < width and d > nearest[i, j]:
                nearest[i, j] = d
                source[i, j] = r * width + c


@compiled
def _behind(nearest: Float32, source: Int32, r: int, c: int, e_x: np.float32, e_y: np.float32, reach: int) -> int:
    """Return the source pixel of the farther surface on either side of a hole, -1 where there is none."""
    height, width = nearest.shape
    best, depth = -1, np.float32(-FAR)
    for side in range(2):
        sign = 1.0 - 2.0 * side
        for step in range(1, reach + 1):
            i, j = int(np.floor(r + sign * e_y * step + 0.5)), int(np.floor(c + sign * e_x * step + 0.5))
            if i < 0 or i >= height or j < 0 or j >= width:
                break
            if source[i, j] >= 0:
                if nearest[i, j] < depth:
                    best, depth = source[i, j], nearest[i, j]
                break
    return best


@compiled
def _fetch(
    image: Float32,
    disparity: Float32,
    u_x: np.float32,
    u_y: np.float32,
    focus: np.float32,
    found: int,
    r: int,
    c: int,
    total: Float32,
) -> None:
    """Read the colour at the place of the source surface that lands exactly on pixel ``(c, r)``."""
    height, width = disparity.shape
    y, x = found // width, found % width
    d = disparity[y, x]
    s = d - focus
    a, b = r - (y - u_y * s), c - (x - u_x * s)
    y1, x1 = y + (1 if a > 0 else -1), x + (1 if b > 0 else -1)
    a, b = abs(a), abs(b)
    if y1 < 0 or y1 >= height or abs(disparity[y1, x] - d) > _SAME_SURFACE_PX:
        y1 = y
    if x1 < 0 or x1 >= width or abs(disparity[y, x1] - d) > _SAME_SURFACE_PX:
        x1 = x
    if abs(disparity[y1, x1] - d) > _SAME_SURFACE_PX:
        y1, x1 = y, x
    one = np.float32(1.0)
    w00, w01, w10, w11 = (one - a) * (one - b), (one - a) * b, a * (one - b), a * b
    for k in range(3):
        total[r, c, k] += w00 * image[y, x, k] + w01 * image[y, x1, k] + w10 * image[y1, x, k] + w11 * image[y1, x1, k]
