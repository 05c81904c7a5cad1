"""The Light Field Toolbox's way to fit a lenslet grid, written from its description, to compare with.

Reference: D. G. Dansereau, Light Field Toolbox v0.5.3, LFBuildLensletGridModel: the raw white image is convolved with a
disc of a third of the pitch; its brightest whole pixels are the centres; lines walked along rows and columns give one
rotation and two spacings, the median of what is left the offset. It divides out no colour and knows no shear.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from lfstereo.lenslet.lattice import Lattice

Array = npt.NDArray[np.float64]
DISC_PITCHES = 1 / 3
BORDER_PX = 25
SUBSAMPLES = 8


def fit_grid_as_lftoolbox(white: npt.NDArray[np.uint16], pitch_px: float, skip_px: float = 250.0) -> Lattice:
    """Return the lattice that the toolbox's method finds in a raw white image.

    ``pitch_px`` is the metadata's; ``skip_px`` the distance of the lines walked.
    """
    peaks = _peaks(white, pitch_px)
    tree = cKDTree(peaks)
    height, width = white.shape
    start = 2.0 * BORDER_PX
    across = [
        _walk(tree, peaks, (start, y), (pitch_px, 0.0), width - start)
        for y in np.arange(start, height - start, skip_px)
    ]
    down = [
        _walk(tree, peaks, (x, start), (0.0, pitch_px * np.sqrt(3)), height - start)
        for x in np.arange(start, width - start, skip_px)
    ]
    tilt_across = np.mean([np.polyfit(walk[2:-3, 0], walk[2:-3, 1], 1)[0] for walk in across])
    tilt_down = np.mean([np.polyfit(walk[2:-3, 1], walk[2:-3, 0], 1)[0] for walk in down])
    angle = float(0.5 * (np.arctan(tilt_across) - np.arctan(tilt_down)))
    spacing = float(np.mean([np.diff(walk[2:-2, 0]).mean() for walk in across[2:-2]])) / np.cos(angle)
    row_spacing = float(np.mean([np.diff(walk[2:-2, 1]).mean() for walk in down[2:-2]])) / np.cos(angle) / 2
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    lattice = Lattice(down[0][0], turn @ [spacing, 0.0], turn @ [spacing / 2, row_spacing])
    index = lattice.indices_inside((height, width), BORDER_PX)
    expected = lattice.origin + index @ lattice.matrix.T
    nearest = peaks[tree.query(np.round(expected))[1]]
    return Lattice(lattice.origin + np.median(nearest - expected, axis=0), lattice.row, lattice.diagonal)


def _peaks(white: npt.NDArray[np.uint16], pitch_px: float) -> Array:
    """Return (x, y) of the whole pixels that are brightest among their eight neighbours after the disc."""
    radius = pitch_px * DISC_PITCHES
    half = int(np.ceil(radius))
    fine = (np.arange((2 * half + 1) * SUBSAMPLES) + 0.5) / SUBSAMPLES - half - 0.5
    inside = np.hypot(*np.meshgrid(fine, fine)) <= radius
    disc = inside.reshape(2 * half + 1, SUBSAMPLES, 2 * half + 1, SUBSAMPLES).mean((1, 3))
    smooth = cv2.filter2D(white.astype(np.float32), -1, (disc / disc.sum()).astype(np.float32))
    top = smooth >= cv2.dilate(smooth, np.ones((3, 3), np.uint8))
    y, x = np.nonzero(top)
    kept = (x > BORDER_PX) & (x < white.shape[1] - BORDER_PX) & (y > BORDER_PX) & (y < white.shape[0] - BORDER_PX)
    return np.column_stack([x[kept], y[kept]]).astype(np.float64)


def _walk(tree: cKDTree, peaks: Array, start: tuple[float, float], step: tuple[float, float], end: float) -> Array:
    """Step from peak to nearest peak, by whole pixels, until the frame ends."""
    place, found = np.asarray(start), []
    while place[int(step[1] > step[0])] <= end:
        found.append(peaks[tree.query(place)[1]])
        place = np.round(found[-1] + step)
    return np.array(found)
