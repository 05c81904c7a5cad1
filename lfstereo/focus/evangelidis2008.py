"""Evangelidis 2008: align two pictures by their enhanced correlation coefficient, blind to gain and offset."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Float64

STEPS = 60
CONVERGED = 1e-5
"""Change of the correlation at which the search ends."""
_SMOOTH_PX = 5
"""Window of the Gaussian that both pictures are blurred by, odd."""


def correlation_of(template: Float32, moved: Float32) -> float:
    """Return the correlation of two ``(V, U)`` pictures as they are, blurred as for their alignment.

    Examples
    --------
    Gain and offset do not matter.

    >>> picture = np.random.default_rng(0).random((20, 30), dtype=np.float32)
    >>> round(correlation_of(picture, 3 * picture + 1), 4)
    1.0
    """
    fixed, free = (cv2.GaussianBlur(p, (_SMOOTH_PX, _SMOOTH_PX), 0).astype(np.float64) for p in (template, moved))
    fixed, free = fixed - fixed.mean(), free - free.mean()
    sizes = float(np.linalg.norm(fixed) * np.linalg.norm(free))
    return float((fixed * free).sum()) / sizes if sizes > 0 else -1.0


def align_homography(template: Float32, moved: Float32, start: Float64) -> tuple[Float64, float]:
    """Return the homography ``W`` with ``moved(W x)`` most like ``template(x)``, and their correlation.

    Parameters
    ----------
    template, moved
        ``(V, U)`` pictures of one scene.
    start
        ``(3, 3)`` px of ``moved`` from px of ``template``.

    Returns
    -------
    The map, and the correlation, -1 where none was found.
    """
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, STEPS, CONVERGED)
    try:
        correlation, found = cv2.findTransformECC(
            template, moved, start.astype(np.float32), cv2.MOTION_HOMOGRAPHY, stop, None, _SMOOTH_PX
        )
    except cv2.error:  # the pictures have nothing in common, or nothing in them
        return start, -1.0
    return found.astype(np.float64), float(correlation)


def align_scale(template: Float32, moved: Float32, start: Float64) -> tuple[Float64, float]:
    """Return the scale and shift ``W`` with ``moved(W x)`` most like ``template(x)``, and their correlation.

    OpenCV aligns by shift, rotation and shift, affine map or homography; of a lens that is focused only scale and
    shift change, and three unknowns are found where texture is too scarce for six.

    Parameters
    ----------
    template, moved
        ``(V, U)`` pictures of one scene.
    start
        ``(3, 3)`` px of ``moved`` from px of ``template``; the mean scale and the shift at the centre are used.

    Returns
    -------
    The map, and the correlation, -1 where none was found.

    References
    ----------
    Evangelidis and Psarakis, "Parametric image alignment using enhanced correlation coefficient maximization" (2008),
    equations 12 to 19, forward additive.
    """
    rows, columns = template.shape
    smooth = (_SMOOTH_PX, _SMOOTH_PX)
    fixed, free = (cv2.GaussianBlur(picture, smooth, 0) for picture in (template, moved))
    slope_x = cv2.filter2D(free, -1, np.array([[-0.5, 0.0, 0.5]], np.float32))
    slope_y = cv2.filter2D(free, -1, np.array([[-0.5], [0.0], [0.5]], np.float32))
    centre = np.array([(columns - 1) / 2, (rows - 1) / 2, 1.0])
    x, y = (
        axis.astype(np.float32) for axis in np.meshgrid(np.arange(columns) - centre[0], np.arange(rows) - centre[1])
    )
    place = start @ centre
    p = np.array([np.sqrt(abs(np.linalg.det(start[:2, :2]))), *(place[:2] / place[2] - centre[:2])])
    last, best = -1.0, (start, -1.0)
    for _ in range(STEPS):
        at = (p[0] * x + np.float32(centre[0] + p[1]), p[0] * y + np.float32(centre[1] + p[2]))
        at = (at[0].astype(np.float32), at[1].astype(np.float32))
        inside = (at[0] >= 0) & (at[0] <= columns - 1) & (at[1] >= 0) & (at[1] <= rows - 1)
        if inside.mean() < 0.1:
            break
        seen, gx, gy = (
            cv2.remap(f, *at, cv2.INTER_LINEAR)[inside].astype(np.float64) for f in (free, slope_x, slope_y)
        )
        wanted = fixed[inside].astype(np.float64)
        seen -= seen.mean()
        wanted -= wanted.mean()
        sizes = float(np.linalg.norm(seen) * np.linalg.norm(wanted))
        correlation = float(seen @ wanted) / sizes if sizes > 0 else -1.0
        if correlation > best[1]:
            shift = [centre[0] + p[1] - p[0] * centre[0], centre[1] + p[2] - p[0] * centre[1]]
            best = np.array([[p[0], 0, shift[0]], [0, p[0], shift[1]], [0, 0, 1]]), correlation
        if correlation - last < CONVERGED and last > -1.0:
            break
        last = correlation
        jacobian = np.stack([gx * x[inside] + gy * y[inside], gx, gy])
        p = p + _step(jacobian, seen, wanted)
    return best


def _step(jacobian: Float64, seen: Float64, wanted: Float64) -> Float64:
    """Return the change of the parameters; ``jacobian`` ``(P, N)``, the two pictures ``(N,)`` of mean 0."""
    hessian = jacobian @ jacobian.T
    hessian[np.diag_indices_from(hessian)] *= 1 + 1e-9
    hessian[np.diag_indices_from(hessian)] += 1e-12
    along_seen, along_wanted = jacobian @ seen, jacobian @ wanted
    solved = np.linalg.solve(hessian, np.stack([along_seen, along_wanted], axis=1))
    above = float(seen @ seen - along_seen @ solved[:, 0])
    below = float(seen @ wanted - along_wanted @ solved[:, 0])
    gain = above / below if below > 0 else 1.0
    return np.asarray(gain * solved[:, 1] - solved[:, 0], np.float64)
