"""Where a calibration begins: focal lengths, poses and rig that need no good guess."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.rig.sightings import Sightings

_FOCALS_PER_EXTENT = np.geomspace(0.4, 25.0, 64)
"""Focal lengths to try, in widths of the image: fields of view of 100 to 2 degrees."""
_FOCAL_STEP = 0.065
"""Relative distance of neighbouring ones."""

PoseGuess = tuple[Float64, Float64, float]
"""Rotation ``(3, 3)``, translation ``(3,)`` m, rms miss in px."""
_CLIP_RAD = 0.1
_TURN_PER_MISS_RAD = 0.01
"""What a pose loses against another by fitting the corners worse by its own miss."""


def start_focal_px(
    shots: Sequence[Sightings],
    points: Float64,
    centre: Float64,
    width_px: float,
    between_px: tuple[float, float] | None = None,
) -> float:
    """Return the focal length that explains the boards best, by trying them all, or all within bounds.

    A search over the whole range stays real and positive whatever the boards; the closed forms from vanishing
    points take the root of a difference, which noise can turn negative.
    """
    totals = []
    focals = width_px * _FOCALS_PER_EXTENT
    if between_px is not None:
        focals = np.geomspace(*between_px, max(2, math.ceil(math.log(between_px[1] / between_px[0]) / _FOCAL_STEP) + 1))
    for focal in focals:
        misses = [_poses(shot, points, focal, centre)[0][2] ** 2 for shot in shots]
        totals.append(float(np.mean(misses)))
    return float(focals[int(np.argmin(totals))])


def start_poses(shot: Sightings, points: Float64, focal: float, centre: Float64) -> list[PoseGuess]:
    """Return the one or two poses that a flat board can have: rotation, translation (m), rms miss (px), best first."""
    return _poses(shot, points, focal, centre)


def start_pupil(shots: Sequence[Sightings], depths: Sequence[Float64], focal: float) -> tuple[float, float]:
    """Return (1/Zf in 1/m, pupil metres per px) from how far corners move from view to view at each depth.

    Parameters
    ----------
    shots
        The corners seen.
    depths
        Per shot the depth of each of the target's corners, ``(N,)`` m.
    focal
        Focal length, px.

    Raises
    ------
    RigError
        If the views of all shots agree, or the motion does not fall with distance.
    """
    rows, motions, weights = [], [], []
    for shot, depth in zip(shots, depths, strict=True):
        for axis in (0, 1):
            o, x, w = shot.offset[:, axis], shot.place[:, axis], shot.weight
            n = np.maximum(np.bincount(shot.corner, w, len(depth)), 1e-12)
            o = o - (np.bincount(shot.corner, w * o, len(depth)) / n)[shot.corner]
            x = x - (np.bincount(shot.corner, w * x, len(depth)) / n)[shot.corner]
            spread = np.bincount(shot.corner, w * o * o, len(depth))
            good = spread > 1e-9
            rows.append(1 / depth[good])
            motions.append((np.bincount(shot.corner, w * o * x, len(depth))[good]) / spread[good])
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
    left: Sequence[Sequence[PoseGuess]], right: Sequence[Sequence[PoseGuess]]
) -> tuple[Float64, Float64, list[Float64], list[Float64]]:
    """Return right_from_left and left_from_board of all shots where the two cameras agree best.

    A flat board seen from afar has two poses that look alike; of each shot's pairs of poses the one nearest to
    the turn that most shots agree on is taken.

    Parameters
    ----------
    left, right
        The poses that each shot can have in either camera, best first.

    Returns
    -------
    Rotation ``(3, 3)`` and translation ``(3,)`` m of right_from_left, and of each shot's left_from_board.
    """
    pairs = [[(a, b) for a in lefts for b in rights] for lefts, rights in zip(left, right, strict=True)]
    turns = [np.stack([b[0] @ a[0].T for a, b in choices]) for choices in pairs]
    price = [np.array([a[2] + b[2] for a, b in choices]) for choices in pairs]
    price = [(p - p.min()) / max(float(p.min()), 1e-9) * _TURN_PER_MISS_RAD for p in price]
    candidates = np.concatenate(turns)
    away = [_angles(candidates, own) + cost for own, cost in zip(turns, price, strict=True)]
    total = sum(np.minimum(a.min(axis=1), _CLIP_RAD) for a in away)
    best = int(np.argmin(total))
    chosen = [choices[int(np.argmin(a[best]))] for choices, a in zip(pairs, away, strict=True)]
    rotation = candidates[best]
    moves = [b[1] - rotation @ a[1] for a, b in chosen]
    return rotation, np.median(moves, axis=0), [a[0] for a, _ in chosen], [a[1] for a, _ in chosen]


def _angles(a: Float64, b: Float64) -> Float64:
    """Return the angles between all rotations of two stacks, ``(A, B)`` rad."""
    trace = np.einsum("aij,bij->ab", a, b)
    angles: Float64 = np.arccos(np.clip((trace - 1) / 2, -1, 1))
    return angles


def _poses(shot: Sightings, points: Float64, focal: float, centre: Float64) -> list[PoseGuess]:
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
