"""Where a calibration begins: focal lengths, poses and rig that need no good guess."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.rig.sightings import Sightings

_FOCALS_PER_EXTENT = np.geomspace(0.4, 25.0, 64)
"""Focal lengths to try, in widths of the image: fields of view of 100 to 2 degrees."""


def start_focal_px(shots: Sequence[Sightings], points: Float64, centre: Float64, width_px: float) -> float:
    """Return the focal length that explains the boards best, by trying them all.

    A search over the whole range stays real and positive whatever the boards; the closed forms from vanishing
    points take the root of a difference, which noise can turn negative.
    """
    totals = []
    for focal in width_px * _FOCALS_PER_EXTENT:
        misses = [_poses(shot, points, focal, centre)[0][2] ** 2 for shot in shots]
        totals.append(float(np.mean(misses)))
    return float(width_px * _FOCALS_PER_EXTENT[int(np.argmin(totals))])


def start_poses(
    shot: Sightings, points: Float64, focal: float, centre: Float64
) -> list[tuple[Float64, Float64, float]]:
    """Return the one or two poses that a flat board can have: rotation, translation (m), rms miss (px), best first."""
    return _poses(shot, points, focal, centre)


def start_pupil(
    shots: Sequence[Sightings], points: Float64, poses: Sequence[tuple[Float64, Float64]], focal: float
) -> tuple[float, float]:
    """Return (1/Zf in 1/m, pupil metres per px) from how far corners move from view to view at each depth.

    Raises
    ------
    RigError
        If the views of all shots agree, or the motion does not fall with distance.
    """
    rows, motions, weights = [], [], []
    for shot, (rotation, translation) in zip(shots, poses, strict=True):
        depth = (points @ rotation.T + translation)[:, 2]
        for axis in (0, 1):
            o, x, w = shot.offset[:, axis], shot.place[:, axis], shot.weight
            n = np.maximum(np.bincount(shot.corner, w, len(points)), 1e-12)
            o = o - (np.bincount(shot.corner, w * o, len(points)) / n)[shot.corner]
            x = x - (np.bincount(shot.corner, w * x, len(points)) / n)[shot.corner]
            spread = np.bincount(shot.corner, w * o * o, len(points))
            good = spread > 1e-9
            rows.append(1 / depth[good])
            motions.append((np.bincount(shot.corner, w * o * x, len(points))[good]) / spread[good])
            weights.append(spread[good])
    inverse_depth, motion, weight = (np.concatenate(v) for v in (rows, motions, weights))
    if not len(motion):
        raise RigError("calibration: each shot has one view only, expected light fields; decode the captures again")
    # motion = focal * pupil * (1/Zf - 1/Z)
    root = np.sqrt(weight)
    system = np.stack([np.ones_like(inverse_depth), -inverse_depth], axis=1)
    (offset, slope), *_ = np.linalg.lstsq(system * root[:, None], motion * root, rcond=None)
    pupil = slope / focal
    if pupil <= 0 or offset <= 0:
        raise RigError(
            "calibration: corners do not move between the views as depth says, expected nearer boards to move more; "
            "photograph the board at three distances or more, from the near to the far end of the working range"
        )
    return float(offset / slope), float(pupil)


def start_rig(
    left: Sequence[tuple[Float64, Float64]], right: Sequence[tuple[Float64, Float64]]
) -> tuple[Float64, Float64]:
    """Return right_from_left (rotation, translation in m) as the middle of what each shot says."""
    turns = [r @ q.T for (q, _), (r, _) in zip(left, right, strict=True)]
    # The turn with the least median angle to the others: a wrong pose among them does no harm.
    angles = [np.median([Rotation.from_matrix(a.T @ b).magnitude() for b in turns]) for a in turns]
    middle = turns[int(np.argmin(angles))]
    moves = [t - middle @ s for (_, s), (_, t) in zip(left, right, strict=True)]
    return middle, np.median(moves, axis=0)


def _poses(shot: Sightings, points: Float64, focal: float, centre: Float64) -> list[tuple[Float64, Float64, float]]:
    corner, place = shot.centre_view()
    ideal = (place - centre) / focal
    count, turns, moves, misses = cv2.solvePnPGeneric(points[corner], ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    found = []
    for index in range(count):
        rotation = cv2.Rodrigues(turns[index])[0]
        translation = moves[index].ravel()
        if translation[2] > 0 and np.all(np.isfinite(rotation)):
            found.append((rotation, translation, float(np.ravel(misses[index])[0]) * focal))
    if not found:
        raise RigError(f"{shot.source}: no pose of the board explains its corners; drop this shot (--drop)")
    return sorted(found, key=lambda pose: pose[2])
