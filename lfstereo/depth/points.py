"""Depth to coloured points."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb, UInt8, check_shape
from lfstereo.depth.triangulate import DepthMap
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.options import option


@dataclass(frozen=True, slots=True)
class PointCloud:
    """Coloured points in the axes of the rectified left camera: x right, y down, z forward."""

    points_m: Float32
    """``(N, 3)`` metres."""
    colours: UInt8
    """``(N, 3)`` sRGB."""

    def __post_init__(self) -> None:
        check_shape("points", self.points_m, (None, 3))
        check_shape("colours of the points", self.colours, (len(self.points_m), 3))


@dataclass(frozen=True, slots=True)
class PointOptions:
    """Which pixels become points."""

    max_depth_m: float | None = option(None, "leave out points farther away", "m")
    edge_step: float | None = option(
        0.02, "leave out pixels whose neighbourhood spans more than this share of their depth; unset: keep all"
    )


def points_from_depth(
    depth: DepthMap,
    colour: Rgb,
    focal_px: float,
    principal_px: tuple[float, float],
    options: PointOptions = PointOptions(),
) -> PointCloud:
    """Return the valid pixels as points: ``X = (u - cx) z / f``, ``Y = (v - cy) z / f``, ``Z = z``.

    At the outline of a near object an interpolated depth belongs to nothing; ``edge_step`` leaves such pixels out.

    Parameters
    ----------
    depth
        Depth of the rectified left view.
    colour
        ``(V, U, 3)`` linear RGB of the same view.
    focal_px
        Focal length of the rectified view, px.
    principal_px
        (cx, cy) of the rectified left view, px.
    options
        Which pixels become points.

    Raises
    ------
    ShapeError
        If the colour picture has another size than the depth.
    ConfigError
        If an option is not positive.

    Examples
    --------
    >>> depth = DepthMap(np.full((1, 3), 2.0, np.float32), np.ones((1, 3), bool))
    >>> points_from_depth(depth, np.zeros((1, 3, 3), np.float32), 4.0, (1.0, 0.0)).points_m[2].tolist()
    [0.5, 0.0, 2.0]
    """
    if colour.shape != (*depth.depth_m.shape, 3):
        raise ShapeError(f"colour: found shape {colour.shape}, expected {(*depth.depth_m.shape, 3)} as the depth")
    kept = _kept(depth, options)
    v, u = np.nonzero(kept)
    z = depth.depth_m[kept].astype(np.float64)
    points = np.stack([(u - principal_px[0]) * z / focal_px, (v - principal_px[1]) * z / focal_px, z], axis=-1)
    return PointCloud(points.astype(np.float32), srgb8(colour[kept]))


def _kept(depth: DepthMap, options: PointOptions) -> Bool:
    kept = depth.valid & (depth.depth_m > 0)
    if options.max_depth_m is not None:
        if not options.max_depth_m > 0:
            raise ConfigError(f"max_depth_m = {options.max_depth_m}: expected a depth above 0 m, or none")
        kept &= depth.depth_m <= options.max_depth_m
    if options.edge_step is not None:
        if not options.edge_step > 0:
            raise ConfigError(f"edge_step = {options.edge_step}: expected a share above 0, or none")
        around = np.ones((3, 3), np.uint8)
        farthest = cv2.dilate(np.where(depth.valid, depth.depth_m, 0).astype(np.float32), around)
        nearest = cv2.erode(np.where(depth.valid, depth.depth_m, np.float32(3e38)), around)
        kept &= farthest - nearest <= options.edge_step * depth.depth_m
    return kept
