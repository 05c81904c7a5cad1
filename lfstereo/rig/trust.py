"""Refuse calibrations that the photographs do not carry, and say what to photograph next."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.rig.sightings import Sightings, reach_px

LEAST_SHOTS = 4
LEAST_TILT_RAD = math.radians(10.0)
LEAST_DEPTH_RATIO = 1.12
LEAST_COVERAGE = 0.4
"""Share of the frame's width and of its height between the outermost corners of all shots."""
LARGEST_BASELINE_SD = 0.02
"""Relative standard deviation of the baseline."""


def check_count(usable: int, given: int) -> None:
    """Refuse too few shots.

    Raises
    ------
    RigError
        If fewer than four shots are usable.
    """
    if usable < LEAST_SHOTS:
        raise RigError(
            f"calibration: {usable} of {given} shots usable, expected {LEAST_SHOTS} or more; photograph the target "
            "about 15 times, sharp and whole in both pictures"
        )


def check_poses(rotations: Float64, translations: Float64, points: Float64) -> None:
    """Refuse boards that are all parallel or all at one distance.

    Parameters
    ----------
    rotations, translations
        ``(P, 3, 3)`` and ``(P, 3)`` m, left_from_board.
    points
        ``(N, 3)`` corners in board axes, m.

    Raises
    ------
    RigError
        If the boards differ by less than 10 degrees, or their distances by less than 12 percent.
    """
    normals = rotations[:, :, 2]
    tilt = float(np.arccos(np.clip(normals @ normals.T, -1, 1)).max())
    if tilt < LEAST_TILT_RAD:
        raise RigError(
            f"calibration: all boards are parallel within {math.degrees(tilt):.1f} degrees, expected "
            f"{math.degrees(LEAST_TILT_RAD):.0f} or more; photograph the board tilted by 20 to 30 degrees to the "
            "left, right, up and down"
        )
    depths = (rotations @ points.mean(axis=0) + translations)[:, 2]
    if depths.max() < LEAST_DEPTH_RATIO * depths.min():
        raise RigError(
            f"calibration: all boards are {depths.min():.2f} to {depths.max():.2f} m away, expected distances that "
            f"differ by {LEAST_DEPTH_RATIO - 1:.0%} or more; photograph the board at the near and far end of the range"
        )


def check_coverage(side: str, shots: Sequence[Sightings], size_px: tuple[int, int]) -> None:
    """Refuse corners that stay in one part of the frame.

    Raises
    ------
    RigError
        If the outermost corners of all shots are less than 40 percent of the frame apart.
    """
    low, high = reach_px(shots)
    for axis, (name, borders) in enumerate((("width", "left and right"), ("height", "upper and lower"))):
        share = float(high[axis] - low[axis]) / size_px[axis]
        if share < LEAST_COVERAGE:
            raise RigError(
                f"calibration: the corners cover {share:.0%} of the {side} frame's {name}, expected "
                f"{LEAST_COVERAGE:.0%} or more; photograph the board near the {borders} borders of the picture"
            )


def check_baseline(baseline_m: float, sd_m: float) -> None:
    """Refuse a baseline that is not known well enough.

    Raises
    ------
    RigError
        If its standard deviation exceeds 2 percent.
    """
    if sd_m > LARGEST_BASELINE_SD * baseline_m:
        raise RigError(
            f"calibration: the baseline is {baseline_m * 1e3:.1f} mm with a standard deviation of {sd_m * 1e3:.2f} mm, "
            f"expected {LARGEST_BASELINE_SD:.0%} or less; photograph more boards, larger in the picture, "
            "tilted and at different distances"
        )


def check_lens_range(side: str, found: Float64, low: Float64, high: Float64) -> None:
    """Refuse a lens at the end of what the captures' metadata allow.

    Parameters
    ----------
    found, low, high
        ``(11,)`` parameters of :func:`lfstereo.rig.intrinsics.plenoptic_rays` and their bounds.

    Raises
    ------
    RigError
        If the focal length, the plane of zero slope or the pupil lies at a bound.
    """
    names = {0: ("focal length", "px"), 1: ("focal length", "px"), 5: ("pupil", "m per px")}
    for index, (name, unit) in names.items():
        if not low[index] < found[index] < high[index]:
            raise RigError(
                f"calibration: the {side} camera's {name} comes out at {found[index]:.4g} {unit} or beyond, expected "
                f"{low[index]:.4g} to {high[index]:.4g} from the metadata; measure square_m on the print, check that "
                "the captures are of one zoom, or accept it with --any-lens"
            )
