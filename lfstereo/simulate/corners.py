"""Calibration shots without pictures: where a simulated rig's lenses show the corners of a board, and how they err."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.rig.bundle import ShotPair
from lfstereo.rig.sightings import Sightings
from lfstereo.simulate.boards import board_target, draw_poses
from lfstereo.simulate.camera import SimulatedCamera
from lfstereo.simulate.options import SimulateOptions
from lfstereo.simulate.rigs import SimulatedRig, build_rig

_ACROSS_PX = 4.4
_OFFSETS_PX = np.stack(np.meshgrid(*[[-_ACROSS_PX, 0.0, _ACROSS_PX]] * 2), axis=-1).reshape(-1, 2)
"""Nine views across the pupil stand for all."""


@dataclass(frozen=True, slots=True)
class CornerErrors:
    """Standard deviations of what corners are off by, sensor px."""

    smooth_px: float = 0.0
    """Alike in all views of a shot and over a part of the board: a print that is bent, blur that changes."""
    reach_m: float = 0.06
    """How far over the board that part reaches."""
    corner_px: float = 0.0
    """Alike in all views of a shot, of each corner alone."""
    view_px: float = 0.0
    """Of each corner in each view alone: noise."""


def seen_places(camera: SimulatedCamera, points: Float64, offset_px: Float64) -> Float64:
    """Return the centres of the micro-images that show points, ``(M, N, 2)`` px.

    All rays of one lenslet meet in a point of the plane of focus. That from the pupil point p to X crosses the plane
    at ``Zf u`` with ``u = (X - p)/Z + p/Zf``, and the lens moves this picture point to ``u (1 + k1 u^2)``.

    Parameters
    ----------
    points
        ``(N, 3)`` in camera axes, m.
    offset_px
        ``(M, 2)`` positions of views inside the micro-images, px from the centre.
    """
    pupil = offset_px[:, None] * camera.pupil_m_per_px
    u = (points[:, :2] - pupil) / points[:, 2:] + pupil / camera.focus_m
    bent = u * (1 + camera.distortion_k1 * np.sum(u**2, axis=-1, keepdims=True))
    places: Float64 = camera.focal_px * bent + camera.principal_px
    return places


def corner_session(options: SimulateOptions, errors: CornerErrors) -> tuple[SimulatedRig, list[ShotPair]]:
    """Simulate the corners of a calibration session in nine views; board poses and errors follow from the seed."""
    rig, points = build_rig(options), board_target(options).points
    apart = np.sum((points[:, None] - points) ** 2, axis=-1)
    smooth = np.linalg.cholesky(np.exp(-apart / (2 * errors.reach_m**2)) + 1e-9 * np.eye(len(points)))
    rng = np.random.default_rng([options.seed, 0xE44])
    count, views = len(points), len(_OFFSETS_PX)
    corner, offset = np.tile(np.arange(count), views), np.repeat(_OFFSETS_PX, count, axis=0)
    pairs = []
    for number, pose in enumerate(draw_poses(options, rig)):
        left = pose.points()
        right = left @ rig.stereo.right_from_left.T + rig.stereo.translation_m
        both = []
        for camera, seen in ((rig.left, left), (rig.right, right)):
            place = seen_places(camera, seen, _OFFSETS_PX) + errors.smooth_px * smooth @ rng.normal(size=(count, 2))
            place += errors.corner_px * rng.normal(size=(count, 2))
            place += errors.view_px * rng.normal(size=(views, count, 2))
            name = f"shot {number:02d} of {camera.serial}"
            both.append(Sightings(name, camera.serial, corner, offset, place.reshape(-1, 2), np.ones(len(corner))))
        pairs.append(ShotPair(f"{number:02d}", both[0], both[1]))
    return rig, pairs
