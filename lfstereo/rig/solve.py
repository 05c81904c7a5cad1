"""Calibrate one light-field camera by itself: its 5 x 5 matrix, distortion and the poses of the target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.progress import Progress, silent
from lfstereo.rig.adjust import Adjustment, BundleState, LensModel, Seen, adjust, points_in_camera
from lfstereo.rig.intrinsics import (
    H13,
    H24,
    H31,
    H33,
    H42,
    H44,
    S0,
    T0,
    U0,
    V0,
    matrix_from_rays,
    matrix_rays,
    ray_distance_m,
)
from lfstereo.rig.sightings import Sightings, usable
from lfstereo.rig.start import start_focal_px, start_poses, start_pupil

LEAST_SHOTS = 3


@dataclass(frozen=True, slots=True)
class CameraSolution:
    """One calibrated light-field camera."""

    matrix: Float64
    """``(5, 5)``: (i, j, k, l, 1) to (s, t in m, u, v as tangents, 1); views counted from the centre view."""
    distortion: tuple[float, float, float, float, float]
    """k1, k2, k3, b1, b2 of :func:`lfstereo.rig.distortion.distort`."""
    sd: Float64
    """``(13,)`` standard deviations of h11 h22 h13 h24 h31 h42 h33 h44 k1 k2 k3 b1 b2."""
    rotations: Float64
    """``(P, 3, 3)`` camera_from_board of each shot."""
    translations: Float64
    """``(P, 3)`` m."""
    sigma_px: float
    """Robust standard deviation of a residual coordinate."""
    ray_rms_m: float
    """Rms distance of the corners from the rays of the pixels they were seen at."""


def solve_camera(
    shots: Sequence[Sightings], points: Float64, size_px: tuple[int, int], progress: Progress = silent
) -> CameraSolution:
    """Calibrate one camera from a target's corners in all its views.

    The eight entries of the matrix are free but for the axis, which goes through the central sample, as are five
    numbers of distortion and six per shot; residuals are in px.

    Parameters
    ----------
    shots
        Corners with ``offset`` in views and ``place`` in px of the views.
    points
        ``(N, 3)`` corners in board axes, m.
    size_px
        (U, V) of a view.

    Raises
    ------
    RigError
        If fewer than three shots are usable, or the views do not tell depth.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), sections 4 and 5; here with residuals in px of the views instead of ray distances.
    """
    shots = [shot for shot in shots if usable(shot)]
    if len(shots) < LEAST_SHOTS:
        raise RigError(
            f"calibration: {len(shots)} usable shots, expected {LEAST_SHOTS} or more; photograph the target tilted in "
            "different directions and at different distances"
        )
    centre = (np.asarray(size_px, np.float64) - 1) / 2
    shots = [Sightings(s.source, s.serial, s.corner, s.offset, s.place - centre, s.weight) for s in shots]
    result = _adjusted(shots, points, float(size_px[0]), progress)
    rays, _ = matrix_rays(result.state.cameras[0])
    misses = []
    for index, shot in enumerate(shots):
        seen = points_in_camera(result.state, points, 0, index)[shot.corner]
        misses.append(ray_distance_m(rays, shot.offset, shot.place, seen)[shot.weight > 0])
    k1, k2, k3, b1, b2 = (float(value) for value in rays[12:])
    rays[[S0, T0]] = -rays[[H13, H24]] * centre
    rays[[U0, V0]] = -rays[[H33, H44]] * centre
    return CameraSolution(
        matrix=matrix_from_rays(rays),
        distortion=(k1, k2, k3, b1, b2),
        sd=np.sqrt(np.diag(result.covariance)[:13]),
        rotations=result.state.rotations,
        translations=result.state.translations,
        sigma_px=result.sigma_px,
        ray_rms_m=float(np.sqrt(np.mean(np.concatenate(misses) ** 2))),
    )


def _adjusted(shots: Sequence[Sightings], points: Float64, width: float, progress: Progress) -> Adjustment:
    centre = np.zeros(2)
    focal = start_focal_px(shots, points, centre, width)
    poses = [start_poses(shot, points, focal, centre)[0] for shot in shots]
    depths = [(points @ rotation.T + translation)[:, 2] for rotation, translation, _ in poses]
    vergence, pupil = start_pupil(shots, depths, focal)
    start = np.zeros(13)
    start[:2] = pupil
    start[[H31, H42]] = -pupil * vergence
    start[[H33, H44]] = 1 / focal
    state = BundleState(
        cameras=(start,),
        rig_rotation=np.eye(3),
        rig_translation=np.zeros(3),
        rotations=np.stack([pose[0] for pose in poses]),
        translations=np.stack([pose[1] for pose in poses]),
    )
    anything = np.full(13, np.inf)
    model = LensModel(matrix_rays, np.ones(13, np.bool_), np.zeros(13), anything, -anything, anything)
    return adjust([model], points, [Seen(0, i, shot) for i, shot in enumerate(shots)], state, progress)
