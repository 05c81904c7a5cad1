"""Axes, units, signs and pixel centres, in one place.

Light field
    ``(T, S, V, U, C)``: view row, view column, image row, image column, colour, the order of the Light
    Field Toolbox. View ``(t, s)`` lies at pupil position ``p = ((s - s0), (t - t0)) * view step``, x to
    the right and y downwards as seen in the upright picture; ``(t0, s0)`` is the centre view.
Image
    ``(H, W, C)``, float32 linear RGB unless a name says otherwise.
Coordinates
    ``(x, y)``, 0-based; pixel centres lie at integers. Camera axes: x right, y down, z forward, metres.
Slope
    ``sigma``, px of image shift between neighbouring views, positive = nearer than the plane of zero slope:
    ``I_ts(x - sigma (s - s0), y - sigma (t - t0)) = I_centre(x, y)``.
Disparity
    ``d >= 0``, px of the rectified left centre view: ``x_right = x_left - d``.
Depth
    ``z = f B / (d + doffs)`` in metres, ``doffs = cx_right - cx_left`` (Middlebury's calib.txt).
Focal stack
    Slice ``k`` of both stacks is focused at the same disparity ``d_k``; the ``d_k`` are evenly spaced and
    run from near (largest disparity) to far.
Unknowns
    An array of unknowns comes with a ``valid`` mask; neither NaN nor 0 carries a message.
"""

from __future__ import annotations

SLICES_DEFAULT = 16
DISPARITY_RANGE_PX = 100.0
"""Largest disparity (px) of the working range that rectification aims at; the networks' label unit."""


def depth_from_disparity(disparity_px: float, focal_px: float, baseline_m: float, doffs_px: float) -> float:
    """Return the depth z in metres of a disparity in px.

    References
    ----------
    Scharstein et al., "High-resolution stereo datasets with subpixel-accurate ground truth" (2014), calib.txt.

    Examples
    --------
    >>> round(depth_from_disparity(10.0, 1000.0, 0.1, 90.0), 6)
    1.0
    """
    return focal_px * baseline_m / (disparity_px + doffs_px)
