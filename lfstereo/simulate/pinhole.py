"""Ideal pictures from one point: the truth that a light field's centre view is compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64, Rgb
from lfstereo.simulate.compiled import compiled_parallel
from lfstereo.simulate.scene import Scene
from lfstereo.simulate.shade import candidates, nearest, shade


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A picture plane without blur, in scene axes, from the origin."""

    focal_px: float
    principal_px: tuple[float, float]
    size: tuple[int, int]
    """(rows, columns)."""


def render(scene: Scene, pinhole: Pinhole, oversample: int = 4) -> Rgb:
    """Return the picture, ``(V, U, 3)`` linear sRGB, each px the mean of ``oversample``^2 rays over its area."""
    picture = np.zeros((*pinhole.size, 3), np.float32)
    _render_rows(
        picture,
        _numbers(pinhole),
        scene.primitives,
        scene.extents,
        scene.light,
        scene.light_maps,
        oversample,
        1 / pinhole.focal_px,
    )
    return picture


def depth(scene: Scene, pinhole: Pinhole) -> Float32:
    """Return z (m) of the first surface through each px centre, ``(V, U)``; infinite where there is none."""
    z = np.full(pinhole.size, np.inf, np.float32)
    _depth_rows(z, _numbers(pinhole), scene.primitives, scene.extents)
    return z


def visible(scene: Scene, points_m: Float64, eye_m: Float64, tolerance_m: float) -> Bool:
    """Return which points ``(..., 3)`` nothing hides from an eye, ``(...)``, up to a tolerance in depth."""
    flat = np.ascontiguousarray(points_m.reshape(-1, 3), np.float64)
    seen = np.ones(len(flat), np.bool_)
    _visible_points(seen, flat, np.asarray(eye_m, np.float64), scene.primitives, tolerance_m)
    return seen.reshape(points_m.shape[:-1])


def _numbers(pinhole: Pinhole) -> Float64:
    return np.array([pinhole.focal_px, *pinhole.principal_px])


@compiled_parallel
def _render_rows(
    picture: Float32,
    pinhole: Float64,
    scene: Float64,
    extents: Float64,
    light: Float64,
    light_maps: Float32,
    oversample: int,
    spot_per_m: float,
) -> None:
    rays = oversample * oversample
    for v in numba.prange(picture.shape[0]):
        among, entry = np.empty(scene.shape[0], np.int64), np.empty(scene.shape[0])
        for u in range(picture.shape[1]):
            x, y = (u - pinhole[1]) / pinhole[0], (v - pinhole[2]) / pinhole[0]
            count = candidates(scene, extents, x, y, 1.0, 0.0, 1 / pinhole[0], among, entry)
            for k in range(rays):
                dx = x + ((k % oversample + 0.5) / oversample - 0.5) / pinhole[0]
                dy = y + ((k // oversample + 0.5) / oversample - 0.5) / pinhole[0]
                which, t = nearest(scene, among, entry, count, 0.0, 0.0, 0.0, dx, dy, 1.0)
                if which < 0:
                    continue
                r, g, b = shade(scene, light, light_maps, which, t * dx, t * dy, t, dx, dy, 1.0, spot_per_m * t)
                picture[v, u, 0] += r / rays
                picture[v, u, 1] += g / rays
                picture[v, u, 2] += b / rays


@compiled_parallel
def _depth_rows(z: Float32, pinhole: Float64, scene: Float64, extents: Float64) -> None:
    for v in numba.prange(z.shape[0]):
        among, entry = np.empty(scene.shape[0], np.int64), np.empty(scene.shape[0])
        for u in range(z.shape[1]):
            dx, dy = (u - pinhole[1]) / pinhole[0], (v - pinhole[2]) / pinhole[0]
            count = candidates(scene, extents, dx, dy, 1.0, 0.0, 0.0, among, entry)
            which, t = nearest(scene, among, entry, count, 0.0, 0.0, 0.0, dx, dy, 1.0)
            if which >= 0:
                z[v, u] = t


@compiled_parallel
def _visible_points(seen: Bool, points: Float64, eye: Float64, scene: Float64, tolerance: float) -> None:
    among, whenever = np.arange(scene.shape[0]), np.zeros(scene.shape[0])
    for n in numba.prange(points.shape[0]):
        dx, dy, dz = points[n, 0] - eye[0], points[n, 1] - eye[1], points[n, 2] - eye[2]
        _, t = nearest(scene, among, whenever, len(among), eye[0], eye[1], eye[2], dx, dy, dz)
        seen[n] = t * dz > dz - tolerance
