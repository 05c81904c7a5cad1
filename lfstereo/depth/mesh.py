"""Depth to a textured surface that is torn where depth jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Bool, Float32, check_shape
from lfstereo.depth.triangulate import DepthMap
from lfstereo.errors import ConfigError
from lfstereo.options import option

_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Row and column of a cell's four pixels: upper left, upper right, lower left, lower right."""
_CUTS = (((0, 2, 1), (1, 2, 3)), ((0, 2, 3), (0, 3, 1)))
"""The two ways to cut a cell into triangles, counter-clockwise as the camera sees them: along the rising diagonal
(upper right to lower left) and along the falling one."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """A textured surface in the axes of the rectified left camera: x right, y down, z forward."""

    points_m: Float32
    """``(N, 3)`` metres."""
    places: Float32
    """``(N, 2)`` where in the picture each point takes its colour, (x, y) from 0 at the upper left edge to 1."""
    triangles: npt.NDArray[np.uint32]
    """``(M, 3)`` corners, counter-clockwise as the camera sees them."""

    def __post_init__(self) -> None:
        check_shape("points of the mesh", self.points_m, (None, 3))
        check_shape("places of the mesh", self.places, (len(self.points_m), 2))
        check_shape("triangles of the mesh", self.triangles, (None, 3))


@dataclass(frozen=True, slots=True)
class MeshOptions:
    """Where the surface is torn."""

    edge_step: float = option(0.02, "leave out triangles whose corners differ by more than this share of their depth")


def mesh_from_depth(
    depth: DepthMap, focal_px: float, principal_px: tuple[float, float], options: MeshOptions = MeshOptions()
) -> Mesh:
    """Return the surface through all valid pixels.

    Each cell of four neighbouring pixels is cut along the diagonal whose ends lie nearer in depth, so that an outline
    runs along the cut; a cell with three good corners gives one triangle. A triangle that would bridge an outline,
    from a near object to what lies behind, is left out.

    Parameters
    ----------
    depth
        Depth of the rectified left view.
    focal_px
        Focal length of the rectified view, px.
    principal_px
        (cx, cy) of the rectified left view, px.
    options
        Where the surface is torn.

    Raises
    ------
    ConfigError
        If ``edge_step`` is not positive.

    Examples
    --------
    Three pixels by two on a wall make two cells of two triangles each.

    >>> wall = DepthMap(np.full((2, 3), 2.0, np.float32), np.ones((2, 3), bool))
    >>> mesh_from_depth(wall, 4.0, (1.0, 0.0)).triangles.shape
    (4, 3)
    """
    if not options.edge_step > 0:
        raise ConfigError(f"edge_step = {options.edge_step}: expected a share above 0")
    rows, columns = depth.depth_m.shape
    index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    z, known = depth.depth_m, depth.valid & (depth.depth_m > 0)
    corner_z = [z[v : rows - 1 + v, u : columns - 1 + u] for v, u in _CORNERS]
    corner_known = [known[v : rows - 1 + v, u : columns - 1 + u] for v, u in _CORNERS]
    corner_index = [index[v : rows - 1 + v, u : columns - 1 + u] for v, u in _CORNERS]
    falling = _cut_falling(corner_z, corner_known)
    pieces = []
    for chosen, cut in ((~falling, _CUTS[0]), (falling, _CUTS[1])):
        for triple in cut:
            keep = chosen & _whole(corner_z, corner_known, triple, options.edge_step)
            pieces.append(np.stack([corner_index[k][keep] for k in triple], axis=-1))
    triangles = np.concatenate(pieces)
    used, renumbered = np.unique(triangles, return_inverse=True)
    v, u = np.divmod(used.astype(np.int64), columns)
    at = z[v, u].astype(np.float64)
    points = np.stack([(u - principal_px[0]) * at / focal_px, (v - principal_px[1]) * at / focal_px, at], axis=-1)
    places = np.stack([(u + 0.5) / columns, (v + 0.5) / rows], axis=-1)
    corners = renumbered.reshape(-1, 3).astype(np.uint32)
    return Mesh(points.astype(np.float32), places.astype(np.float32), corners)


def _cut_falling(z: list[Float32], known: list[Bool]) -> Bool:
    """Tell which cells are cut from upper left to lower right: those whose other diagonal spans more, or is broken."""
    falling_step, rising_step = np.abs(z[0] - z[3]), np.abs(z[1] - z[2])
    falling_known, rising_known = known[0] & known[3], known[1] & known[2]
    chosen: Bool = np.where(falling_known == rising_known, falling_step < rising_step, falling_known)
    return chosen


def _whole(z: list[Float32], known: list[Bool], triple: tuple[int, int, int], edge_step: float) -> Bool:
    """Tell which cells hold a triangle of three known corners of like depth."""
    corners = np.stack([z[k] for k in triple])
    nearest = corners.min(axis=0)
    keep: Bool = np.logical_and.reduce([known[k] for k in triple])
    keep &= corners.max(axis=0) - nearest <= edge_step * nearest
    return keep
