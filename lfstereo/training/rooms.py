"""Furnished scenes: the floor, walls and ceiling of a room, boxes, and up to 60 things in front of them.

What is known to matter for a network that meets photographs later: an indoor background of slanted planes and many
objects of every size in front of it (Yan, Lipson, Deng et al., "What makes good synthetic training data for stereo
matching?", 2025), with disparity histograms that differ from scene to scene. Surfaces are those of
:mod:`lfstereo.training.scenes`: a room seen from inside is the nearest of its planes along each ray.
"""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.training.layers import Column
from lfstereo.training.scenes import Scene, dress, flat_object, random_scene

_STEEPEST = 0.35
"""Largest slope of a plane, px of disparity per px."""


def room_scene(rng: np.random.Generator, textures: Float32, height: int, width: int, top_px: float = 100.0) -> Scene:
    """Draw a room: two to six walls, none to eight boxes, 8 to 55 other things.

    Parameters
    ----------
    rng
        Decides everything.
    textures
        ``(N, 256, 256, 3)`` bank.
    height, width
        Size in px of the views that will be rendered.
    top_px
        Largest disparity.
    """
    near = rng.uniform(0.35, 1.0) * top_px
    far = rng.uniform(0.0, 0.5) * near
    rows = _walls(rng, near, far, height, width)
    things: list[list[Float64]] = [_box_faces(rng, near, far, height, width) for _ in range(int(rng.integers(0, 9)))]
    count, power = int(np.exp(rng.uniform(np.log(8), np.log(55)))), rng.uniform(0.6, 1.8)
    shrink = (12 / max(count, 12)) ** 0.4
    for d in far + (near - far) * rng.random(count) ** power:
        things.append([flat_object(rng, float(d), near, far, round(height * shrink), width)])
        things[-1][0][Column.CY] = rng.uniform(-0.05, 1.05) * height
    things.sort(key=lambda faces: float(faces[0][Column.D]))
    layers = np.stack([*rows, *(face for faces in things for face in faces)]).astype(np.float32)
    dress(rng, layers, len(textures))
    return Scene(layers, textures, height, width)


def mixed_scene(rng: np.random.Generator, textures: Float32, height: int, width: int, top_px: float = 100.0) -> Scene:
    """Draw a room three times out of four, else layers of :func:`lfstereo.training.scenes.random_scene`."""
    draw = room_scene if rng.random() < 0.75 else random_scene
    return draw(rng, textures, height, width, top_px)


SCENES = {"layers": random_scene, "rooms": room_scene, "mixed": mixed_scene}
"""Kind of scene -> what draws it."""


def _walls(rng: np.random.Generator, near: float, far: float, height: int, width: int) -> list[Float64]:
    """Back wall first, then any of floor, ceiling and side walls, each meeting it along a line in the picture."""
    tilt = rng.uniform(-0.1, 0.1) * (near - far)
    walls = [_plane(width / 2, height / 2, far, tilt / width, 0.0)]
    reach = rng.uniform(0.5, 1.0) * (near - far)
    if rng.random() < 0.7:
        line = rng.uniform(0.35, 0.85) * height
        walls.append(_plane(width / 2, line, far, 0.0, min(reach / (height - line), _STEEPEST)))
    if rng.random() < 0.2:
        line = rng.uniform(0.1, 0.3) * height
        walls.append(_plane(width / 2, line, far, 0.0, -min(reach / line, _STEEPEST)))
    for share, sign in ((0.3, -1.0), (0.3, 1.0)):
        if rng.random() < share:
            edge = rng.uniform(0.05, 0.35) * width
            x = edge if sign < 0 else width - edge
            walls.append(_plane(x, height / 2, far, sign * min(reach / edge, _STEEPEST), 0.0))
    return walls


def _plane(x: float, y: float, d: float, d_x: float, d_y: float) -> Float64:
    row = np.zeros(Column.COUNT)
    row[[Column.CX, Column.CY, Column.HALF_W, Column.HALF_H, Column.COS]] = x, y, 1e4, 1e4, 1
    row[[Column.D, Column.D_X, Column.D_Y]] = d, d_x, d_y
    return row


def _box_faces(rng: np.random.Generator, near: float, far: float, height: int, width: int) -> list[Float64]:
    """Two faces of an upright box that meet in the edge nearest to the cameras."""
    d = rng.uniform(far, near)
    half_h = height * rng.uniform(0.04, 0.3) * (0.5 + d / 100)
    x, y = rng.uniform(0, 1) * width + rng.uniform(0, d), rng.uniform(0.1, 1.0) * height
    faces = []
    for sign in (-1.0, 1.0):
        half_w = half_h * np.exp(rng.uniform(-1.2, 0.5))
        slope = min(rng.uniform(0.02, 0.3), (d - far) / (2 * half_w))
        face = np.zeros(Column.COUNT)
        face[[Column.SHAPE, Column.HALF_W, Column.HALF_H, Column.COS]] = 1, half_w, half_h, 1
        face[[Column.CX, Column.CY]] = x + sign * half_w, y
        face[[Column.D, Column.D_X]] = d - slope * half_w, -sign * slope
        faces.append(face)
    return faces
