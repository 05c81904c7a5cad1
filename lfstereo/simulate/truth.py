"""What is true of a simulated pair: depth, disparity, occlusion and ideal centre views, all rectified."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tifffile

from lfstereo.arrays import Bool, Disparity, Float32, Float64, Rgb
from lfstereo.depth.pfm import write_pfm
from lfstereo.depth.pictures import write_png
from lfstereo.lightfield.encoding import srgb8
from lfstereo.rig.geometry import RectifiedGeometry, Side, rectified_geometry
from lfstereo.rig.rig import PlenopticCamera, StereoRig
from lfstereo.simulate.pinhole import Pinhole, depth, render, visible
from lfstereo.simulate.scene import Scene

_OCCLUSION_TOLERANCE_M = 5e-4
"""Depth by which something must lie before a point to hide it: above rounding, far below any object's thickness."""


@dataclass(frozen=True, slots=True)
class Truth:
    """Maps of the rectified left centre view."""

    disparity: Disparity
    """``(V, U)`` px."""
    depth_m: Float32
    """``(V, U)`` z in metres."""
    valid: Bool
    """``(V, U)``: seen by the left sensor, and inside the right camera's field of view."""
    occluded: Bool
    """``(V, U)``: inside the right camera's field of view but hidden from its pupil centre."""
    centre_left: Rgb
    """``(V, U, 3)`` linear sRGB from the left pupil centre, without blur or noise."""
    centre_right: Rgb
    """``(V, U, 3)`` likewise from the right one."""


def true_maps(scene: Scene, rig: StereoRig, oversample: int = 5) -> Truth:
    """Ray-cast the scene from the pupil centres through every rectified px.

    Parameters
    ----------
    scene
        In left camera axes.
    rig
        The exact rig.
    oversample
        Rays per px and axis of the ideal views.
    """
    geometry = rectified_geometry(rig)
    left = scene.seen_from(geometry.left.rectified_from_camera, np.zeros(3))
    right = left.seen_from(np.eye(3), np.array([-geometry.baseline_m, 0.0, 0.0]))
    views = {side: _pinhole(geometry, side) for side in ("left", "right")}
    z = depth(left, views["left"])
    points = _points(z, views["left"])
    eye = np.array([geometry.baseline_m, 0.0, 0.0])
    disparity = (geometry.focal_px * geometry.baseline_m / z - geometry.doffs_px).astype(np.float32)
    in_left = on_sensor(points @ geometry.left.rectified_from_camera, rig.left)
    in_right = on_sensor((points - eye) @ geometry.right.rectified_from_camera, rig.right)
    column = np.arange(geometry.size[1]) - disparity
    valid = in_left & in_right & (column >= 0) & (column <= geometry.size[1] - 1)
    return Truth(
        disparity=disparity,
        depth_m=z,
        valid=valid,
        occluded=valid & ~visible(left, points, eye, _OCCLUSION_TOLERANCE_M),
        centre_left=render(left, views["left"], oversample),
        centre_right=render(right, views["right"], oversample),
    )


def write_truth(folder: Path, truth: Truth) -> None:
    """Write the maps into an existing folder: PFM px, TIFF metres, PNG masks (255 = yes) and sRGB views."""
    write_pfm(folder / "disparity.pfm", truth.disparity)
    tifffile.imwrite(folder / "depth.tiff", truth.depth_m)
    write_png(folder / "valid.png", truth.valid.astype(np.uint8) * np.uint8(255))
    write_png(folder / "occlusion.png", truth.occluded.astype(np.uint8) * np.uint8(255))
    write_png(folder / "centre_left.png", srgb8(truth.centre_left))
    write_png(folder / "centre_right.png", srgb8(truth.centre_right))


def _pinhole(geometry: RectifiedGeometry, side: Side) -> Pinhole:
    return Pinhole(geometry.focal_px, geometry.camera(side).principal_px, geometry.size)


def _points(z: Float32, view: Pinhole) -> Float64:
    rows, columns = np.mgrid[: view.size[0], : view.size[1]]
    x = (columns - view.principal_px[0]) / view.focal_px * z
    y = (rows - view.principal_px[1]) / view.focal_px * z
    return np.stack([x, y, z.astype(np.float64)], axis=-1)


def on_sensor(points: Float64, camera: PlenopticCamera, margin_px: float = 0.0) -> Bool:
    """Return which points ``(..., 3)`` in camera axes fall on the camera's sensor, at least a margin from its edge."""
    x, y = points[..., 0] / points[..., 2], points[..., 1] / points[..., 2]
    gain = 1 + camera.distortion[0] * (x * x + y * y)
    x = camera.focal_px[0] * x * gain + camera.principal_px[0] - margin_px
    y = camera.focal_px[1] * y * gain + camera.principal_px[1] - margin_px
    width, height = (n - 1 - 2 * margin_px for n in camera.sensor_px)
    inside: Bool = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
    return inside
